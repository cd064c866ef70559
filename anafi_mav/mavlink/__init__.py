"""The MAVLink side of the wire: dialect, endpoints and channels, router, stream intervals.

Nothing of Parrot's protocol is here.

``dialect`` is generated (dialect/generate.py). The way of a message in: bytes → `channel` → `router` → `node` →
the callback `Node.on_message`; out: `Node.send` → every `channel`.
"""
