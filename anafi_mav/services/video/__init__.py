"""Video streams of the camera component."""
