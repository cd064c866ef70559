"""The translation of a whole mission to the drone's files, and the check before a flight."""
