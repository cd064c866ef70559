"""Parrot's mux: ARSDK, the web server and the video over one TCP connection to a Skycontroller 4."""
