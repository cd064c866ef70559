"""One connection of Parrot's Olympe that does everything: ``olympe_visit.py ADDRESS CLASS MODEL HTTP RTSP FOLDER``.

CLASS is Olympe's: Drone, SkyController3 or SkyController4. MODEL (4k, thermal, usa, ai) only says what is worth asking
for. HTTP and RTSP are the aircraft's ports; with RTSP 0 no one looks. Downloads go to FOLDER. Written against Olympe
alone. Prints one JSON object: of each part what its steps came to, and what Olympe believes. Olympe's log goes to
stderr.
"""

from __future__ import annotations

import sys
from pathlib import Path

from olympe_base import Visit, quiet
from olympe_controller import Controller
from olympe_flight import Flight
from olympe_look import Look
from olympe_payload import Payload
from olympe_plan import Plan


class Everything(Flight, Controller, Look, Payload, Plan, Visit):
    pass


def main() -> None:
    *where, folder = sys.argv[1:]
    quiet()
    visit = Everything(*where)
    if visit.connect():
        if visit.direct:
            visit.fly()
        else:
            visit.use_controller()
        if where[-1] != "0":
            visit.watch_live()
        visit.use_payload(Path(folder))
        visit.play_plan()
        visit.begin("end")
        visit.disconnect()
    visit.end()


if __name__ == "__main__":
    main()
