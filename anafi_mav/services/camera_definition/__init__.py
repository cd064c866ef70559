"""Settings of the camera: their table, the camera definition file, and the extended parameter protocol."""
