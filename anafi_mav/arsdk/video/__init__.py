"""The live video's wire formats: RTSP, SDP, RTP, RTCP, H.264 in packets, and Parrot's metadata."""
