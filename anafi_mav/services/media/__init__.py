"""The drone's photos and videos: over MAVLink FTP, and brought home after a landing."""
