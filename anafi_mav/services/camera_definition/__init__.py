"""Settings of the camera: their table, their definition file, and extended parameters."""
