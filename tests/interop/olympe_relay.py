"""A stream of the gateway in Parrot's own player: ``olympe_relay.py URL TITLE``.

Prints one JSON object: whether it plays, and the sizes of the first 40 decoded pictures.
"""

from __future__ import annotations

import json
import sys
import threading
from typing import Any

from olympe.features.video.pdraw import Pdraw

PICTURES, LIMIT = 40, 30.0


def main() -> None:
    sizes: list[tuple[int, int]] = []
    enough = threading.Event()

    def decoded(frame: Any) -> None:
        info = frame.info()["raw"]["frame"]["info"]
        sizes.append((info["width"], info["height"]))
        if len(sizes) >= PICTURES:
            enough.set()

    player = Pdraw()
    played = bool(player.play(url=sys.argv[1], media_name=sys.argv[2], raw_cb=decoded, timeout=LIMIT))
    enough.wait(LIMIT)
    player.stop()
    player.destroy()
    json.dump({"played": played, "sizes": sizes[:PICTURES]}, sys.stdout)


if __name__ == "__main__":
    main()
