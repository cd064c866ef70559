"""Element video: the live stream, its pictures and their metadata."""
