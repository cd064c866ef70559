"""Flight plans: a neutral `Plan`, its file formats and their losses.

The plan is in `plan`, the formats are in `files`; a `Loss` is a part of a plan that a format cannot hold.
"""
