"""anafi-mav: Parrot ANAFI drones as MAVLink systems.

The rooms of the package and who may import whom are drawn in ``docs/architecture.md``.
"""

__version__ = "0.1.0"
