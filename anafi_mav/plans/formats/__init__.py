"""File formats of flight plans: read and written, with a line for each thing that is lost."""
