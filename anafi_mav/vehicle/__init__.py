"""The flight core: one vehicle and its flight tasks. Knows no channel, message or service."""
