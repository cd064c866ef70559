"""What all flight tasks stand on: the aircraft, modes, heights, bounds, and the velocity loop."""
