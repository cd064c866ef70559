"""Puts drones on a zenoh network, and leads ground stations to them.

`endpoint` is the gateway's side, `ground` that of the stations (docs/fabric.md).
"""
