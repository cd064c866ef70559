"""Elements of what the drone flies by itself: flight plans, animations, follow me, points of interest."""
