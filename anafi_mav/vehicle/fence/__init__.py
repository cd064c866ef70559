"""Bounds of a flight: the fence, rally points, and the items of a plan that they are made of. No I/O."""
