"""MAVLink FTP: the server and its files; the drone's flight logs."""
