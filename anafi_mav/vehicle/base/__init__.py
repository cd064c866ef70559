"""Shared base of all flight tasks: aircraft, modes, heights, bounds, velocity loop."""
