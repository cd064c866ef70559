"""The simulated payload: cameras, gimbals, memory cards, and the files that they write."""
