"""Gimbal manager of a vehicle (MAVLink gimbal protocol v2), and the older mount protocol."""
