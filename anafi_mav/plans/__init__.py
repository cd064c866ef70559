"""Flight plans: a neutral `Plan`, its file formats and their losses.

The plan is in `plan`, the formats are in `formats`; a `Loss` is a part of a plan that a format cannot hold.

No I/O, except that `formats.files` reads and writes files.
"""
