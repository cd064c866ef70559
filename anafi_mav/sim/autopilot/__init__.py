"""The simulated autopilot: flying state, guidance, return, plans, and the ends of a flight."""
