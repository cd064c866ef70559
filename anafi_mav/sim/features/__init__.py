"""Parrot's features beside flight and payload: settings, Wi-Fi, and the Ai's protobuf services."""
