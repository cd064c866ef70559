"""Flight plans: one neutral plan and its file formats. Nothing lives here yet; the room is kept for it."""
