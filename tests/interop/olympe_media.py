"""Olympe's own media examples, as they are installed: ``olympe_media.py ADDRESS PORT drone|skycontroller FOLDER``.

Knows nothing of this project. Each example takes a burst, downloads every file of it while it is being taken, compares
them with the drone's MD5, counts them and deletes them. Prints one JSON object: the assertion that failed,
if one did. Olympe's log goes to stderr.
"""

from __future__ import annotations

import functools
import json
import os
import sys
import tempfile

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # Olympe logs to stdout

ADDRESS, PORT, VIA, FOLDER = sys.argv[1:5]
os.environ |= {"DRONE_IP": ADDRESS, "DRONE_HTTP_PORT": PORT, "SKYCTRL_IP": ADDRESS}
tempfile.tempdir = FOLDER

import olympe  # noqa: E402
from olympe.examples import media_ai, skyctrl_media  # noqa: E402
from olympe.features.media import media as media_feature  # noqa: E402


def count_each_file_once(listener: type[skyctrl_media.MediaEventListener]) -> None:
    """Let the examples' listener count a file once that Olympe downloads twice.

    Olympe does so on a busy machine, when a file is created while its media is listed.
    """
    unsubscribe = listener.unsubscribe

    def count(self: skyctrl_media.MediaEventListener) -> None:
        self._media.wait_for_pending_downloads()
        self._downloaded_resources = list({file.resource_id: file for file in self._downloaded_resources}.values())
        unsubscribe(self)

    listener.unsubscribe = count


def main() -> None:
    olympe.log.update_config({"loggers": {name: {"level": "WARNING"} for name in ("olympe", "ulog", "urllib3")}})
    # The examples end with a disconnect() that must succeed. What would follow is Olympe's own way out, in which its
    # timers race each other (one of 2 s against a count of turns that is meant to be 3 s) and which takes seconds.
    olympe.Drone.destroy = olympe.SkyController4.destroy = lambda self: None
    # It tries once to open the websocket of the media, for half a second, and knows nothing of them if that fails.
    media_feature.HTTP_CONNECTION_TIMEOUT = 60.0
    # The example knows the address alone, and its web server to be on port 80.
    olympe.SkyController4 = functools.partial(olympe.SkyController4, http_port=int(PORT))
    # This example's own listener downloads the whole media again for each file that is reported, and then finds
    # that it has more files than the drone. The other example's downloads once.
    media_ai.MediaEventListener = skyctrl_media.MediaEventListener
    count_each_file_once(skyctrl_media.MediaEventListener)
    # It also says everything to the older camera feature first, which an Ai does not speak, and waits ten seconds.
    media_ai.configure_photo_burst_mode = skyctrl_media.setup_photo_burst_mode
    # Its other half, with a Media of one's own, cannot succeed: it asks the drone for what only that Media receives.
    example = media_ai.test_media_ai_internal_media if VIA == "drone" else skyctrl_media.test_media
    try:
        example()
        failed = None
    except AssertionError as error:
        failed = str(error)
    print(json.dumps({"failed": failed}), file=OUT, flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
