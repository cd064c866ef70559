"""Wire formats of the live video: RTSP, SDP, RTP, RTCP, H.264, metadata. No I/O."""
