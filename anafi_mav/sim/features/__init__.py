"""Parrot's other features: settings, Wi-Fi, and the Ai's protobuf services."""
