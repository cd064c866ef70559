"""The drone's photos and videos: over MAVLink FTP, and downloaded after a landing."""
