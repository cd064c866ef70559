"""MAVLink microservices of one system over a drone: a folder for each, over the modules that lie here."""
