"""Parrot's mux: ARSDK, web server and video over one TCP connection to a Skycontroller 4."""
