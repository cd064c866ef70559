"""Recording of a session: MAVLink as a tlog and ARSDK as a trace, on one clock."""
