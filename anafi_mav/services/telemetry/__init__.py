"""Telemetry: the builder of each message, and when it is due on which channel."""
