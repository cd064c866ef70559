"""RTSP relay: the live video of a drone, from one session to many viewers."""
