"""Flight by setpoints: the stream, its goals, its moves, and take-off by setpoint."""
