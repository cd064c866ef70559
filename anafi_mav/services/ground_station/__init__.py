"""Services that a ground station expects: identity, banner, time, shell, tunes, keys."""
