"""MAVLink FTP: the server, its files, and the empty flight logs."""
