"""The simulated video server: RTSP, the streams, and their pictures as H.264."""
