"""The simulated autopilot: the flying state, guidance, return, plans, and what ends a flight."""
