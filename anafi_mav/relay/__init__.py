"""RTSP relay: the live video of each drone, from one session at the drone to any number of viewers."""
