"""Elements of automatic flight: flight plans, animations, follow me, points of interest."""
