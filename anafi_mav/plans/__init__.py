"""Flight plans: one neutral `Plan` (`plan`), its file formats (`formats`), and its translation for a drone.

No I/O, except that `formats.files` reads and writes files.
"""
