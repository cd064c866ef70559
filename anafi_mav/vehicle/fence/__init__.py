"""Bounds of a flight: fence, rally points, and the plan items that define them. No I/O."""
