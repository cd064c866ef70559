"""Wire formats of the live video: RTSP, SDP, RTP, RTCP, packets of H.264, Parrot's metadata."""
