"""The mission protocol: missions, fences and rally points, by messages and by files."""
