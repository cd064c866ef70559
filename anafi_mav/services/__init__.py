"""MAVLink microservices of one system over a drone.

Each microservice has a folder; the modules that lie here are the floor of all of them.
"""
