"""The MAVLink side of the wire: dialect, endpoints and channels, router, stream intervals. No word of Parrot's here.

``dialect`` is generated (dialect/generate.py). The way of a message in: bytes → `channel` → `router` → `node` →
whoever set `Node.on_message`; out: `Node.send` → every `channel`.
"""
