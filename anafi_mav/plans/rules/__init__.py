"""The rules by which each MAV_CMD becomes lines of the drone's flight plan files."""
