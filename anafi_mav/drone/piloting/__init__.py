"""Element piloting: take-off, sticks, moves, return and landing, and the flight's settings."""
