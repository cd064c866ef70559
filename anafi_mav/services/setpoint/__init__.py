"""Setpoints and sticks of clients: offboard, manual control, and the target to follow."""
