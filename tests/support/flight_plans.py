"""A flight plan as a drone of the first version reads it."""

from __future__ import annotations

V1 = b"""QGC WPL 120
0\t0\t3\t22\t0.0\t0.0\t0.0\t0.0\t48.878900\t2.367700\t5.0\t1
1\t0\t3\t93\t2.0\t0.0\t0.0\t0.0\t0.0\t0.0\t0.0\t1
2\t0\t3\t16\t0.0\t5.0\t0.0\t0.0\t48.879000\t2.367700\t8.0\t1
3\t0\t3\t93\t60.0\t0.0\t0.0\t0.0\t0.0\t0.0\t0.0\t1
"""
