"""Flight of a mission: its parts, the drone's files, progress, and the record for a restart."""
