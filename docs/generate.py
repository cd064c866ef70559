"""Writes the pages of this folder that follow from the code. With --check it only says which are stale (exit 1)."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec

HERE = Path(__file__).parent
TESTS = HERE.parent / "tests"
DIALECT_XML = HERE.parent / "dialect" / "anafi.xml"
sys.path[:0] = [str(HERE.parent), str(TESTS), str(HERE)]

CONFIGURATION = """\
# Configuration

<!-- Made by docs/generate.py from anafi_mav/config/schema.py. -->

For people who run more than one drone, or change a default. After reading you can write the YAML file of
`anafi-mav run -c fleet.yaml`. Two drones or a hundred are a longer list, nothing else:

```yaml
endpoints: ["udpout://127.0.0.1:14550", "udpout://127.0.0.1:14540", "tcpin://127.0.0.1:5760?flavour=ardupilot"]
drones:
  - {name: alpha, sysid: 1, address: 192.168.42.1}            # a real ANAFI
  - {name: bravo, sysid: 2, sim: {model: 4k, home: [48.8789, 2.3677, 35.0]}}
```

An error is one line with the file, the key and the expected value. The exit status is then 2, and nothing has been
started:

```
anafi-mav: fleet.yaml: drones[1].sysid: expected a sysid of its own, 1 is already at drones[0].sysid
```

Options of the command line replace a list of the file, or of the defaults:

| option | replaces |
|---|---|
| `--drone ADDRESS` (repeatable) | `drones`, with ids 1, 2, …; `192.168.42.1%wlan1` names the interface too |
| `--endpoint URL` (repeatable) | `endpoints` |
| `--allow-kill` | `allow_kill: true` |

An id of `--drone` outside of `sysids` is refused.

One gateway uses one `state` folder. Its file `gateway.lock` names the process and its drones. A second gateway with the
same folder is refused: two gateways on one computer need a folder each. A gateway with an unusable folder runs. It
warns at the start and at each upload, stores nothing, and its exit status is 1.

Every ANAFI has the same address in its own Wi-Fi, and so has every Skycontroller. With a Wi-Fi adapter for each, and
the adapter's name as `interface`, they fly together, without address translation:

```yaml
drones:
  - {name: left, sysid: 1, address: 192.168.42.1, interface: wlan1}
  - {name: right, sysid: 2, address: 192.168.42.1, interface: wlan2}
```

Linux only. `net.ipv4.conf.*.rp_filter` has to be 0 or 2 (`sysctl -a | grep rp_filter`): with 1 the kernel drops the
answers of all but one of them.
"""

ENDPOINTS = """
## Endpoint URLs

| URL | what happens |
|---|---|
| `udpout://HOST:PORT` | sends to HOST:PORT and receives the answers: for a client that waits at a known port |
| `udpin://HOST:PORT` | waits at HOST:PORT; each client that sends something is served |
| `tcpin://HOST:PORT` | waits at HOST:PORT for TCP connections |
| `tcpout://HOST:PORT` | connects to HOST:PORT by TCP |
| `serial:///dev/ttyUSB0:57600` | a serial line, here with 57600 baud |
| `zenoh://HOST:PORT` | connects to a zenoh router, for stations anywhere ([fabric](fabric.md)) |

Over UDP a host name stands for its IPv4 address, where it has one: ground stations listen there.

An endpoint has the options of [this table](#endpoints). They have two forms with the same meaning, in a URL and as
keys. In a URL they follow `?`, are joined by `&`, and a list is joined by commas. In a shell, put the URL in quotes:

```yaml
endpoints:
  - udpout://127.0.0.1:14550
  - udpin://0.0.0.0:14551?access=observe&systems=1,3-5&max_clients=4
  - {url: "udpin://0.0.0.0:14552", access: observe, systems: [1, 3-5], max_clients: 4}
  - {url: "serial:///dev/ttyUSB0:57600", bytes_per_second: 2000}
```

`udpin` and `tcpin` listen on HOST alone: give a loopback address unless the network may connect. A program that reaches
an endpoint without [`signing`](security.md) can do what its `access` permits.

### Access

| `access` | its clients may | and may not |
|---|---|---|
| `observe` | see telemetry, parameters, plans, files, logs; set the rates of their own streams | change anything |
| `control` | also fly, stop, steer gimbal and cameras, change camera settings and plans | maintain the drone |
| `all` | also maintain: write parameters, restart, calibrate, format, delete files, use the shell | – |

- A message beyond the access has no effect. A command is answered with DENIED, a parameter with PARAM_ERROR and its
  value, a plan with MISSION_ACK DENIED, a file request with FILE_PROTECTED; a text names the access. `refused_access`
  of the gateway's counters has their number, in total and by message.
- It is not forwarded to other systems either. Files of those are written with `all` only: among them are parameters
  and scripts. Of an observer's messages only a station's heartbeat and what
  reads from one system are forwarded: no rates and no ends of file sessions, which that system has for all of the
  gateway's clients. Nothing is forwarded in the name of a drone of the gateway, or of a system that is heard on an
  endpoint with more access (`refused_observer`): give observers system ids of their own.
- An observer that reads a plan keeps no other client from changing it.
- The heartbeat of an observer does not count as a ground station's: with `ANF_GCS_LOSS` set, the drone acts on the loss
  of the last station that may control it.
- A pose at more than ten times a second opens the live video for an observer too, as it does for every client.
- Several clients of one endpoint have the same access. Give observers an endpoint of their own.

`systems` limits an endpoint to some drones: the others are invisible there, and a message to them has no effect
(`refused_systems`). What its clients send to all is not forwarded, but for a station's heartbeat and for what these
systems themselves send to no target.

`allow_messages` and `block_messages` filter what is streamed. A client that requests the rate of a
filtered message gets DENIED. Answers are not filtered.

### Forged addresses

The sender's address of a datagram can be forged, so that the answer floods another computer. A client of `udpin` beyond
loopback is therefore served in full only after its third datagram within 10 s:

| it has sent | it gets, and at most ten times its bytes (with IP and UDP headers) |
|---|---|
| a frame to all systems, as HEARTBEAT | heartbeats, in turn over the systems; each further frame renews them |
| a frame to one system | the answer |
| the third datagram with a valid frame within 10 s | everything, without a limit |

A station with a heartbeat a second is served after 2 s. A forger needs three datagrams for each address. TCP, `udpout`
and loopback are not limited. A command has its effect with the first datagram: this limits what is sent, not who may
fly. Addresses without proof have `max_clients` places of their own, in which a new one replaces the one that has been
silent for longest, at once. Replaced and refused clients are warnings in the log: one of each kind in 10 s, with the
number of the others.

### Byte budget

`bytes_per_second` is for radios and mobile networks. It counts bytes of MAVLink frames, for each client by itself.

- Answers leave first, in turn with the newest heartbeat of each component. A stream waits until half a second's bytes
  wait; then its oldest message is dropped and counted (`dropped_frames`).
- All streams of a client are slowed down by one factor until they take 80 % of the budget, or less while answers fill
  the rest. MAV_CMD_GET_MESSAGE_INTERVAL returns the interval in effect.
- Below 5000 bytes/s, messages that repeat others are left out: ATTITUDE_QUATERNION, LOCAL_POSITION_NED, ALTITUDE and
  MOUNT_ORIENTATION. A client can request them. One drone takes 2000 bytes/s with them and 1350 without.
- A list of parameters takes half of the budget.

A serial line of 57600 baud or less is taken for a SiK radio and has 2000 bytes/s. For a cable set
`bytes_per_second: 5760`. A faster line has what its baud rate carries.

### Datagrams

A datagram of `udpout` and `udpin` carries one MAVLink frame: some programs (gomavlib since 3.3.2, and so mavp2p) read
only the first frame of a datagram. `frames: many` puts several into one, up to `datagram_bytes`. It is for a large
fleet and for a client that reads them all:

| client | reads up to |
|---|---|
| gomavlib before 3.3.2 | 512 bytes |
| mavlink-router | 1120 bytes |
| MAVSDK, QGroundControl, pymavlink | 1400 bytes and more |

### Broadcast

No endpoint sends to a broadcast address: each station in the network would get the telemetry and could fly, and a
Wi-Fi sends broadcasts at its lowest rate. `udpout` to such an address is refused at the start. Instead:

| station | endpoint |
|---|---|
| only listens, as QGroundControl at port 14550 | one `udpout` for each station |
| connects or sends first | one `udpin` for all of them |
"""


def _default(field: Any) -> str:
    if field.required:
        return "required"
    value = msgspec.to_builtins(field.default)
    if isinstance(value, list | tuple) and value and isinstance(value[0], dict):
        return "one simulated drone, `{name: anafi, sysid: 1, sim: {}}`"
    return "–" if value is None else f"`{msgspec.json.encode(value).decode()}`"


def _rows(struct: type[msgspec.Struct]) -> Iterator[str]:
    info = msgspec.inspect.type_info(struct)
    assert isinstance(info, msgspec.inspect.StructType)
    for field in info.fields:
        meta = field.type
        assert isinstance(meta, msgspec.inspect.Metadata), f"{struct.__name__}.{field.name} has no Meta"
        assert meta.extra is not None
        assert meta.extra_json_schema is not None
        meaning = meta.extra_json_schema["description"]
        yield f"| `{field.name}` | {meta.extra['expected']} | {_default(field)} | {meaning} |"


def configuration() -> str:
    """docs/configuration.md."""
    from anafi_mav.config import schema

    parts = [CONFIGURATION]
    for place, struct in schema.SECTIONS.items():
        doc = " ".join((struct.__doc__ or "").split())
        title = "The file" if place == "the file" else f"`{place}`"
        parts.append(f"\n## {title}\n\n{doc}\n\n| key | value | default | meaning |\n|---|---|---|---|\n")
        parts.extend(row + "\n" for row in _rows(struct))
    return "".join(parts) + ENDPOINTS


SEED = """\
# The rows of the anafi_ros paper

<!-- Made by docs/generate.py from tests/support/seed_rows.py. -->

For users of anafi_ros, and of the Python API. After reading you know the name in `anafi_mav.drone.Drone` for each
function of that paper.

The appendix of the paper lists what a program can do with an ANAFI: 5 topics to command it, 29 topics to read, 24
services and 25 parameters. Each row has its counterpart in `Drone`. The last columns have the results of
`tests/unit/drone/test_seed_rows.py` on each model of the simulator, over its real sockets:

* **yes**: the row is read or driven, and the drone confirms it;
* **no**: this model does not have it, and the verb raises `NotSupported`;
* **–**: not shown by that test, for the reason given.
"""


def seed() -> str:
    """docs/seed.md."""
    from support.seed_rows import MODELS, ROWS, Row

    def shown(row: Row, model: str) -> str:
        if row.drive is None:
            return "–"
        return "yes" if model in row.models else "no"

    parts = [SEED]
    for kind in dict.fromkeys(row.kind for row in ROWS):
        rows = [row for row in ROWS if row.kind == kind]
        columns = " | ".join(MODELS)
        parts.append(f"\n## {kind.capitalize()}s ({len(rows)})\n\n| row | in `Drone` | {columns} | test |\n")
        parts.append("|---|---|" + "---|" * (len(MODELS) + 1) + "\n")
        for row in rows:
            cells = " | ".join(shown(row, model) for model in MODELS)
            test = "–" if row.drive is None else f"`test_a_row[{row.name}-…]`"
            parts.append(f"| `{row.name}` | {row.how} | {cells} | {test} |\n")
    return "".join(parts)


SEED_MAVLINK = """\
# The rows of the anafi_ros paper over MAVLink

<!-- Made by docs/generate.py from tests/support/seed_mavlink.py. -->

For users of anafi_ros who change to MAVLink. After reading you know the MAVLink message, command or parameter for each
function of that paper ([seed.md](seed.md)). Messages that begin with `ANAFI_` are in [dialect.md](dialect.md),
parameters that begin with `ANF_` in [parameters.md](parameters.md).

| row | MAVLink | shown by |
|---|---|---|
"""


def seed_mavlink() -> str:
    """docs/seed-mavlink.md."""
    from support.seed_mavlink import REACHED

    rows = []
    for name, reach in REACHED.items():
        file, _, function = reach.test.partition("::")
        shown = f"`{function}` in `tests/{file}`" if reach.test else f"waits for {reach.waits}"
        rows.append(f"| `{name}` | {reach.mavlink or '–'} | {shown} |\n")
    return SEED_MAVLINK + "".join(rows)


DIALECT = """\
# The dialect

<!-- Made by docs/generate.py from dialect/anafi.xml. -->

For programmers who read values that MAVLink has no field for. After reading you can request and decode them.

The gateway speaks MAVLink's `ardupilotmega` and `development` dialects and the messages below. They carry what an ANAFI
and its Skycontroller report and MAVLink has no field for. Component 1 sends them to a client that requests them:

| to receive | send |
|---|---|
| one message | `MAV_CMD_REQUEST_MESSAGE` |
| a stream | `MAV_CMD_SET_MESSAGE_INTERVAL` |

The interval of a stream is a lower bound: a message is sent when the drone has reported a new value.

A value that the drone has not reported is the field's "unknown". Enums keep Parrot's numbers. A later firmware may add
numbers that are not listed.

Python programs use the definitions of the package, here with pymavlink, which this package does not install. The
entries of `dialect.enums` have a name and `has_location`, but not pymavlink's descriptions:

```python
from anafi_mav.mavlink import dialect
from pymavlink import mavutil

mavutil.mavlink = dialect
connection = mavutil.mavlink_connection("udpin:127.0.0.1:14550", dialect=None)
```

C programs include the headers that `python dialect/generate.py --c FOLDER` writes (it needs pymavlink):
`FOLDER/anafi/mavlink.h`. For other languages use pymavlink's `mavgen` with `dialect/anafi.xml` beside pymavlink's own
definitions.

| id | message | contents |
|---|---|---|
"""


def _text(element: ET.Element) -> str:
    return " ".join((element.text or "").split())


def _described(element: ET.Element) -> str:
    description = element.find("description")
    assert description is not None, f"{element.get('name')} has no description"
    return _text(description)


def dialect() -> str:
    """docs/dialect.md."""
    root = ET.parse(DIALECT_XML).getroot()
    messages, enums = list(root.iterfind("messages/message")), list(root.iterfind("enums/enum"))
    parts = [DIALECT]
    for message in messages:
        name = message.get("name") or ""
        first = _described(message).partition(". ")[0].rstrip(".")
        parts.append(f"| {message.get('id')} | [`{name}`](#{name.lower()}) | {first} |\n")
    parts.append("\n## Messages\n")
    for message in messages:
        parts.append(f"\n### {message.get('name')}\n\nId {message.get('id')}. {_described(message)}\n\n")
        parts.append("| field | type | unit | unknown | meaning |\n|---|---|---|---|---|\n")
        for field in message.iterfind("field"):
            enum = field.get("enum")
            unit = f"[`{enum}`](#{enum.lower()})" if enum else field.get("units") or "–"
            unknown = f"`{field.get('invalid')}`" if field.get("invalid") else "–"
            parts.append(f"| `{field.get('name')}` | `{field.get('type')}` | {unit} | {unknown} | {_text(field)} |\n")
    parts.append("\n## Enums\n")
    for enum in enums:
        bits = " Bits, which can be combined." if enum.get("bitmask") == "true" else ""
        parts.append(f"\n### {enum.get('name')}\n\n{_described(enum)}{bits}\n\n")
        parts.append("| value | name | meaning |\n|---|---|---|\n")
        for entry in enum.iterfind("entry"):
            parts.append(f"| {entry.get('value')} | `{entry.get('name')}` | {_described(entry)} |\n")
    return "".join(parts)


PARAMETERS = """\
# Parameters

<!-- Made by docs/generate.py from anafi_mav/services/parameter/parameter_table*.py. -->

For people who set up a drone. After reading you know each parameter, its names for PX4's and ArduPilot's clients, and
when a write counts.

A value is stored once and has several names. Every client sees the native ones, `ANF_*`. A client of the PX4 flavour
also sees PX4's names, a client of the ArduPilot flavour ArduPilot's. A write by one name is reported under all of them,
to every client.

Ranges are the drone's own: it reports them with each setting. A client reads them in `parameter.json`, which
QGroundControl and MAVSDK load by themselves over MAVLink FTP.

| request | answer |
|---|---|
| a write | the confirmed value, when the drone has confirmed it |
| a write out of range, to a read-only name, or of another type | PARAM_ERROR |
| a read of a name that is not listed | PARAM_ERROR |
| a read of an unknown value | -1; no parameter is ever NaN |

The drone keeps its own settings, and the gateway keeps its settings for each drone. Seven begin with their default at
each start: `ANF_HAND_LAUNCH`, `ANF_CRUISE_SPEED`, `ANF_CLIMB_SPEED`, `ANF_FENCE_ON`, `ANF_SC_OFFBOARD`, `ANF_SC_WHEELS`
and `ANF_SC_BUTTONS`.
"""

PARAMETERS_NATIVE = """
## Native

| name | meaning | unit | values | PX4 | ArduPilot | source of value and range | models |
|---|---|---|---|---|---|---|---|
"""

PARAMETERS_FACTS = """
## Facts by {title}'s names

Parameters that its clients request and that can only be read. A parameter of QGroundControl's setup pages that an ANAFI
does not have is listed with a neutral value: "not available on ANAFI".

| name | meaning | value | unit | source |
|---|---|---|---|---|
"""


def parameters() -> str:
    """docs/parameters.md."""
    from anafi_mav.services.parameter.parameter_service import NATIVE_NAMES
    from anafi_mav.services.parameter.parameter_table_ardupilot import ARDUPILOT_NAMES
    from anafi_mav.services.parameter.parameter_table_px4 import PX4_NAMES
    from anafi_mav.services.parameter.parameter_table_setup import NOT_AVAILABLE

    def twins(name: str, names: Any) -> str:
        found = [f"`{one.name}`" + (f" ({one.unit})" if one.unit else "") for one in names if one.native == name]
        return ", ".join(found) or "–"

    def values(one: Any) -> str:
        return ", ".join(f"{value} {what}" for value, what in one.values.items()) or "a range"

    def stated(one: Any) -> str:
        if one.source != "fact":
            return "–"
        value = one.read(None)
        return "not reported: -1" if value != value else f"{value:g}"

    parts = [PARAMETERS, PARAMETERS_NATIVE]
    for one in sorted(NATIVE_NAMES, key=lambda parameter: parameter.name):
        text = f"{one.short}. {one.long}".strip() if one.long else one.short
        where = f"`{one.source}`" if "." in one.source else one.source
        both = f"{twins(one.name, PX4_NAMES)} | {twins(one.name, ARDUPILOT_NAMES)}"
        parts.append(
            f"| `{one.name}` | {text} | {one.unit or '–'} | {values(one)} | {both} | {where} | {one.models} |\n"
        )
    for title, names in (("PX4", PX4_NAMES), ("ArduPilot", ARDUPILOT_NAMES)):
        parts.append(PARAMETERS_FACTS.format(title=title))
        for one in sorted(names, key=lambda parameter: parameter.name):
            if not one.native:
                where = f"`{one.source}`" if "." in one.source else one.source
                what = f"{one.short}: {one.long.lower().rstrip('.')}" if one.long == NOT_AVAILABLE else one.short
                parts.append(f"| `{one.name}` | {what} | {stated(one)} | {one.unit or '–'} | {where} |\n")
    return "".join(parts)


CAMERA_SETTINGS = """\
# Camera settings

<!-- Made by docs/generate.py from anafi_mav/services/camera_definition and the simulated models. -->

For people who set up the camera from a ground station, and for programmers. After reading you know each setting, the
models that have it, and the answers to a write.

The camera is component 100. Its settings are extended parameters (PARAM_EXT). QGroundControl, MAVSDK's `camera` plugin
and MAVProxy's `camera` module load the definition file and list the settings by themselves. The file is made from what
the drone reports: the options of another firmware appear in it.

| file | address |
|---|---|
| in MAVLink FTP of component 100, named by CAMERA_INFORMATION | `mftp://camera_definition.xml.xz` |
| the same, not compressed | `mftp://camera_definition.xml` |
| on the gateway's [web server](web.md) | `/drone/SYSID/camera_definition.xml`, and with `.xz` |

The address has no `[;comp=100]`, because MAVSDK opens it as it is written. Without it the file belongs to the component
that announces it. The version is a hash of the content. When the drone reports other capabilities, CAMERA_INFORMATION
is sent again with another version. Options stay for the whole connection, even if the drone stops reporting them: it
reports some for its present mode only.

| write | PARAM_EXT_ACK | sent besides |
|---|---|---|
| the drone has confirmed the value | ACCEPTED | PARAM_EXT_VALUE to every client |
| the drone has not answered within 0.25 s | IN_PROGRESS, later the result | – |
| the same again before the result | IN_PROGRESS | nothing more to the drone |
| a value that is not in the definition, or of another type | VALUE_UNSUPPORTED, value in effect | – |
| refused by the drone, or while it records or takes photos | FAILED, value in effect | value and a text to the client |
| while the flown mission needs the camera | FAILED, value in effect | value and a text to the client |
| an unknown name | FAILED | – |

A change by the pilot, by another client or by the drone itself is sent to every client as PARAM_EXT_VALUE. It is sent
once more after a second, because no client acknowledges it. Some changes take others with them: a video mode selects a
resolution and a frame rate that it can record. They are sent too.

## Settings

A column of a model has the options or the range that the simulated model reports. "All" is each value of the row, "–" a
setting that the model does not have. "Counts while" names values of other settings: ground stations hide it otherwise.
While the camera records, the settings marked † are refused.

| name | meaning | type | values | {titles} | counts while |
|---|---|---|---|{rules}---|
"""

SHOWN_OPTIONS = 12
"""Longest list of options that is written out; of a longer one the ends and the number."""


def _options(setting: Any, options: Any) -> str:
    """Return the options of a setting; of a choice the numbers are the values, of all others the texts."""
    is_choice = setting.kind.is_choice
    texts = [f"`{value:g}` {text}" if is_choice else text for value, text in options]
    return f"{texts[0]} to {texts[-1]} ({len(texts)})" if len(texts) > SHOWN_OPTIONS else "; ".join(texts)


def _of_model(setting: Any, entry: Any, union: Any) -> str:
    """Return the values of a setting on one model."""
    if entry is None:
        return "–"
    if entry.limits is not None:
        return f"{entry.limits.low:.4g} to {entry.limits.high:.4g}"
    if len(entry.options) == len(union):
        return "all"
    if setting.kind.is_choice:
        return ", ".join(f"{option.value:g}" for option in sorted(entry.options))
    return _options(setting, entry.options)


def camera_settings() -> str:
    """docs/camera-settings.md."""
    from support.camera_states import MODEL_KEYS, catalogue

    from anafi_mav import models
    from anafi_mav.services.camera_definition.camera_setting import Guard
    from anafi_mav.services.camera_definition.catalogue import SETTINGS

    catalogues = [catalogue(key) for key in MODEL_KEYS]
    titles = " | ".join(models.MODELS[key].title for key in MODEL_KEYS)
    parts = [CAMERA_SETTINGS.format(titles=titles, rules="---|" * len(MODEL_KEYS))]
    for setting in SETTINGS:
        entries = [found[setting.name] if setting.name in found.index else None for found in catalogues]
        union = sorted({option.value: option for entry in entries if entry for option in entry.options}.values())
        cells = [_of_model(setting, entry, union) for entry in entries]
        counts = []
        for name, values in setting.only_in.items():
            known = {option.value for found in catalogues if name in found.index for option in found[name].options}
            counts.append(f"`{name}` is {', '.join(f'{value:g}' for value in sorted(known & values))}")
        row = (
            f"`{setting.name}`" + (" †" if setting.guard is Guard.CAPTURE else ""),
            setting.title + (f", {setting.unit}" if setting.unit else ""),
            "INT32" if setting.kind.is_choice else setting.kind.name,
            _options(setting, union) if union else "a range",
            *cells,
            "; ".join(counts) or "–",
        )
        parts.append(f"| {' | '.join(row)} |\n")
    return "".join(parts)


CAMERA = """\
# Camera

<!-- Made by docs/generate.py from the tables of the services and tests/support/camera_commands.py. -->

For operators who take photos and videos from a ground station, and for programmers of MAVLink clients. After reading
you know what the camera component does, what each acknowledgement means, and which commands an ANAFI does not have.

The camera is component 100 of each drone's system, in every flavour. Its settings are on a page of
[their own](camera-settings.md), and so is the [gimbal](gimbal.md), which is component 1's.

## Modes

| | |
|---|---|
| photo in video mode, recording in photo mode | TEMPORARILY_REJECTED to component 100: change the mode first |
| the same to component 1 (ArduPilot flavour, and the older commands) | the mode is changed first |
| photo mode while the thermal or blended picture is shown | TEMPORARILY_REJECTED: that camera only records |
| change of mode while it records or takes photos | TEMPORARILY_REJECTED |
| no card, or one that cannot be used | DENIED with a text; TEMPORARILY_REJECTED while it is checked or formatted |

## Photos

| MAV_CMD_IMAGE_START_CAPTURE | effect |
|---|---|
| one picture | what the setting `CAM_PHOTOMODE` says: single, burst or bracketing; of a series the first picture |
| a fraction or a negative number of pictures | DENIED |
| an interval, with 0 or several pictures | a time-lapse; the photo settings of before are restored at its end |
| sequence number (param4) from 1 | the same number again takes no second photo |
| without a sequence number | each command takes a photo, unless its `confirmation` is above 0 |

ACCEPTED means that the drone has begun. The drone rounds an interval to one that it has: a text names it.
DO_SET_CAM_TRIGG_DIST is a GPS-lapse.

One CAMERA_IMAGE_CAPTURED per picture is sent to every client, whether a client, a mission or the pilot took it. It
is sent within a second of the drone's report that the picture is stored; `capture_result` is 0 for one that is
lost. Place, height and orientation are those of the camera when the shutter opened: of the live video's picture at
that time while it runs, else interpolated between events. An unknown place is 0. `file_url` is the file in the
camera's MAVLink FTP; it is empty when the drone has not listed the file in time, and is then filled in for a later
request. A series is listed after each of the first ten pictures, then each time it has grown by a tenth, and at its
end: a list names all its pictures, and the radio carries the controls, too.

Photos of the history are requested by index (param2), by range (param2 to param3) or all (-1), at most 100 at a
time; 2000 are kept until the gateway ends. Their places and orientations are not kept over a restart of the
gateway. The index goes on, and begins again only after a format. MAVSDK requests missing photos; an index that does
not exist is DENIED.

Photos that are taken while the drone's link is lost are not reported. The gateway ends a series that has all its
pictures. While the link is lost the drone takes more; the series is ended, and the settings are restored, when the
link is back.

PANORAMA_CREATE takes one of Parrot's panoramas: from 360 deg the spherical one, from 180 deg the horizontal or
vertical one, below it the super wide one where the drone has it. It turns the drone, so the drone must hover. Any
flight command, Hold among them, ends it; so does IMAGE_STOP_CAPTURE, and the drone hovers.

## Recordings

A recording that the pilot, a mission or the drone began is shown like one of a client, with its time by the drone's
clock. One that ends by itself, for instance on a full card, is a text. MAV_CMD_VIDEO_STOP_CAPTURE without a
recording is ACCEPTED.

## Zoom

CAMERA_SETTINGS has the zoom as a share (%) of the range from 1 to the largest factor. A step is a factor of 1.25. A
rate goes on to the end of the range or until a rate of 0; ACCEPTED means that the zoom moves. While the thermal or
blended picture is shown, a zoom is TEMPORARILY_REJECTED: that camera has none.

## Storage

Each storage has a number from 1: on the Ai 1 is the internal memory and 2 the card. STORAGE_INFORMATION is sent when
anything of it changes. A removed card is EMPTY, a card that the drone does not accept NOT_SUPPORTED, with a text.
The one with the flag STORAGE_USAGE_FLAG_SET is written to: the setting `CAM_STORAGE` and the present cards decide.
`available_capacity` is its free space.

MAV_CMD_STORAGE_FORMAT needs the number where there are two storages. It is refused in flight, while recording and
while photos are taken, and UNSUPPORTED for a storage that the drone cannot format. It cannot be cancelled.
IN_PROGRESS is sent after 2.5 s only, because MAVSDK takes it for the end and its program aborts at the real one. A
format that takes longer is a timeout to it, and "no response" to QGroundControl: watch the storage.

## Repeated commands

A client that receives no acknowledgement sends the command again. Mode, source, zoom to a share or at a rate,
recording, photos by distance, reset and stops are then carried out again, so ACCEPTED always means that it is so now.
What counts is not done twice:

| command | the same from the same client |
|---|---|
| photo with a sequence number | answered again for 3.5 s after the last time |
| photo without one, step of zoom | a new one, unless `confirmation` is above 0; then answered again for 3.5 s |
| format | answered again for 3.5 s, a new one after a photo or recording |
| panorama | answered again for 3.5 s while it is being taken |

Between two equal ones, another command for photos makes the second photo a new one if it has no sequence number; a
zoom does so for a step. It does not matter which client sent it, or to which component.

MAVSDK repeats every 0.5 s with `confirmation` 0, and numbers its photos. QGroundControl sends these commands once.

## Missions

While items to come of the flown mission need the camera, stopping a recording, series or panorama, mode, zoom, source
and reset are TEMPORARILY_REJECTED. A single photo is taken whenever the drone can. A paused mission frees the camera.

## Commands

"–" means that the component answers UNSUPPORTED. In the ArduPilot flavour some commands are also component 1's, with
camera id 0 or 1. Commands to component 0 are answered by the component that has them.

| id | MAV_CMD | component 1 | component 100 | models, or the reason |
|---|---|---|---|---|
"""

CAMERA_MESSAGES = """
## Messages

"sent" means on request (MAV_CMD_REQUEST_MESSAGE), and most of them also at an interval (MAV_CMD_SET_MESSAGE_INTERVAL).

| id | message | component 1 | component 100 | models, or the reason |
|---|---|---|---|---|
"""


def camera() -> str:
    """docs/camera.md."""
    import asyncio

    from support import camera_commands

    async def rows() -> str:
        return _camera_rows(camera_commands.make_system())

    return asyncio.run(rows())


def _camera_rows(system: Any) -> str:
    from support import camera_commands as table

    from anafi_mav import models

    thermal = ", ".join(models.MODELS[key].title for key in table.THERMAL_MODELS)
    autopilot, camera = system.components
    parts = [CAMERA]

    def last(name: str, cells: list[str]) -> str:
        if name in table.THERMAL_ONLY:
            return thermal
        return "all" if any(cell != "–" for cell in cells) else table.REASONS[name]

    for id, name in table.commands():
        cells = []
        for component, other in ((autopilot, camera), (camera, autopilot)):
            offered = [flavour.name for flavour in table.flavours(component, other, id)]
            cells.append("done" if len(offered) == 2 else "ArduPilot flavour" if offered else "–")
        parts.append(f"| {id} | {name} | {' | '.join(cells)} | {last(name, cells)} |\n")
    parts.append(CAMERA_MESSAGES)
    for id, name in table.messages():
        cells = []
        for component in (autopilot, camera):
            received = any(id in service.messages() for service in component.services)
            cells.append("sent" if component.messages.has(id) else "received" if received else "–")
        parts.append(f"| {id} | {name} | {' | '.join(cells)} | {last(name, cells)} |\n")
    return "".join(parts)


COMMANDS = """\
# Commands

<!-- Made by docs/generate.py from the tables of the services and tests/support/autopilot_commands.py. -->

For people who write a MAVLink program or wonder about a refusal. After reading you know which commands fly the vehicle.

A command goes to the vehicle's system id and component 1, as COMMAND_LONG or COMMAND_INT. One to component 0 is
answered by the component that has it. Those of camera, gimbal, storage and video are in [camera.md](camera.md). Every
other one is UNSUPPORTED.

ACCEPTED means that the drone has confirmed it. IN_PROGRESS is sent while it takes longer, and a refusal has a
STATUSTEXT with the reason ([texts](texts.md)). COMMAND_CANCEL ends a command under way, but no take-off, landing,
return or other stop.

"place": x and y are latitude and longitude. "height": z is one. "frame": as its frame says, above mean sea level in a
COMMAND_LONG. "AMSL": above mean sea level in relative frames too, except for clients of the ArduPilot flavour.

| id | MAV_CMD | what it does | place | height | flavours |
|---|---|---|---|---|---|
"""


def commands() -> str:
    """docs/commands.md."""
    import asyncio

    from support import autopilot_commands, camera_commands

    async def rows() -> str:
        return _command_rows(*camera_commands.make_system().components, dict(autopilot_commands.FLIGHT))

    return asyncio.run(rows())


def _command_rows(autopilot: Any, camera: Any, texts: dict[str, str]) -> str:
    from support import autopilot_commands

    from anafi_mav.services.commands import Altitude
    from anafi_mav.services.flavours import ARDUPILOT, PX4, STANDARD

    heights = {Altitude.UNUSED: "–", Altitude.BY_FRAME: "frame", Altitude.AMSL: "AMSL"}
    flavours = {"PX4": PX4, "ArduPilot": ARDUPILOT, "standard": STANDARD}
    parts = [COMMANDS]
    for id, name, row in autopilot_commands.rows(autopilot, camera):
        offered = [title for title, flavour in flavours.items() if row is None or row.offered(flavour)]
        place, height = ("–", "–") if row is None else ("yes" if row.location else "–", heights[row.altitude])
        clients = "all" if len(offered) == len(flavours) else ", ".join(offered)
        parts.append(f"| {id} | {name} | {texts.pop(name)} | {place} | {height} | {clients} |\n")
    if texts:
        raise ValueError(f"tests/support/autopilot_commands.py: no component has {', '.join(texts)}")
    return "".join(parts)


SILENCE = """\
# Commands that the simulator does not answer

<!-- Made by docs/generate.py from tests/support/silent_commands.py. -->

For programmers who test an ARSDK controller on the simulator. After reading you know which commands have no event in
answer, and why.

`tests/unit/sim/test_silence.py` sends every declared command to each model and each Skycontroller, with several values
and in every relevant state. The simulator answers all of them at once by an event, except these.
"""


def silence() -> str:
    """docs/silence.md."""
    from support.silent_commands import CONTROLLERS, DRONES

    parts = [SILENCE]
    for title, column, table in (("Drones", "models", DRONES), ("Skycontrollers", "generations", CONTROLLERS)):
        parts.append(f"\n## {title}\n\n| commands | {column} | why |\n|---|---|---|\n")
        for row in table:
            names = ", ".join(f"`{name}`" for name in row.names.split())
            parts.append(f"| {names} | {', '.join(row.where)} | {row.reason} |\n")
    return "".join(parts)


STATES = """\
# State machines

<!-- Made by docs/generate.py from the tables of the code. -->

For people who change a protocol or the flight core. After reading you know the states, the events and the transitions
of each machine.

A test walks every pair of state and event. An event without an arrow changes nothing: it is ignored, refused or
deferred, or it cannot happen. The module's text has the reason.
"""


def states() -> str:
    """docs/states.md."""
    from anafi_mav.services.ftp import ftp
    from anafi_mav.services.plan import plan_transfer
    from anafi_mav.sim.autopilot import machine
    from anafi_mav.vehicle import flight_policy, operator_control, takeoff_machine
    from anafi_mav.vehicle.base import control_machine
    from anafi_mav.vehicle.fence import fence_watch
    from anafi_mav.vehicle.mission import machine as mission_machine
    from anafi_mav.vehicle.offboard import stream

    tables: list[tuple[str, Any]] = [
        ("Transfer of a mission, a fence or rally points", plan_transfer),
        ("Control: the active flight task", control_machine),
        ("Arming and take-off", takeoff_machine),
        ("The flight of a mission", mission_machine),
        ("The fence: zones, floor and ceiling each", fence_watch),
        ("Setpoints of a program", stream),
        ("The switch between the Skycontroller's pilot and programs", flight_policy),
        ("The operator among several stations", operator_control),
        ("A session of MAVLink FTP", ftp),
        ("The simulated drone's flight", machine),
    ]
    parts = [STATES]
    for title, module in tables:
        table = module.TRANSITIONS
        parts.append(f"\n## {title}\n\n`{module.__name__}`\n\n```mermaid\nstateDiagram-v2\n")
        for state, row in table.items():
            by_target: dict[Any, list[str]] = {}
            for event, target in row.items():
                for one in target if isinstance(target, tuple) else (target,):
                    by_target.setdefault(one, []).append(event.name)
            for target, events in by_target.items():
                parts.append(f"    {state.name} --> {target.name}: {', '.join(events)}\n")
        parts.append("```\n\n| | |\n|---|---|\n")
        for state in table:
            if isinstance(state.value, str):
                parts.append(f"| state `{state.name}` | {state.value} |\n")
        parts += [f"| event `{event.name}` | {event.value} |\n" for event in module.Event]
    return "".join(parts)


PLAN_TRANSLATION = """\
# What a mission becomes

<!-- Made by docs/generate.py from the table of anafi_mav/plans/rules/rules.py. -->

For people who plan missions. After reading you know how an ANAFI flies each command, and which ones it refuses.

A drone flies a file of Parrot's, of version 1 (ANAFI 4K, Thermal, USA) or 2 (Ai). The mission is stored as it was
uploaded; the drone flies a translation.

* **exact**: {exact}.
* **approximated**: {approximated}.
* **stepped**: {stepped}. The drone's own plan ends before
  it and another one begins after it. If the gateway or the link to the drone fails meanwhile, the drone hovers and
  does not continue.
* **refused**: {refused}, with the item and the reason. So is each command that is
  not in the table.

Rules for all of them:

* Heights count from take-off, or from mean sea level when the height of the take-off point is known; not from the
  terrain. A missing place, or 0, 0, is where the drone is then. A missing height is the drone's height then.
* A way point counts as reached within {acceptance:g} m unless it names a radius. A heading that is not set is towards
  the way point. Holding and loitering is a delay after it.
* From the ground the drone takes off first, whatever the mission begins with. Without a take-off item it then
  climbs straight to the height of the first way point, which a text reports.
* A mission that begins in its middle sets first what the earlier items had set: speed, region of interest, view and
  gimbal. It also resumes photos or a video that they had begun and not ended.
* An Ai that flies begins a file with a flight to above its first way point. For actions before that one, such as a
  photo, an additional way point keeps them at their place.
* A file has at most {lines} lines. A longer mission is flown in several files (stepped).
* An item that does not continue by itself, and one after a landing, are refused. Items after a return or an
  endless loop are never reached, which a text reports.
* Photos are rectilinear unless SET_STILL_CAPTURE_MODE changes it: MAVLink has no field for it.

| command | | how |
|---|---|---|
"""


def plan_translation() -> str:
    """docs/plan-translation.md."""
    from anafi_mav.plans.rules import flight_plan_writer, rules
    from anafi_mav.plans.rules.rule import Fidelity
    from anafi_mav.plans.translation import translate

    meanings = {verdict.name.lower(): verdict.value for verdict in Fidelity}
    parts = [PLAN_TRANSLATION.format(**meanings, acceptance=flight_plan_writer.ACCEPTANCE, lines=translate.MAX_LINES)]
    for row in rules.TABLE.values():
        parts.append(f"| {row.command} {row.name} | {row.verdict.name.lower()} | {row.how} |\n")
    return "".join(parts)


PYTHON_API = """\
# Reference of the Python API

<!-- Made by docs/generate.py from the docstrings of anafi_mav/drone. -->

For programs that fly an ANAFI: every stable name of `anafi_mav.drone`. [python-api.md](python-api.md) is the guide.
Methods of the code that are not on this page belong to the package and may change.

For all elements:

- `state` is a frozen record of the drone's last reports. None in a field: not reported since the connection.
- `drone.camera[0]` and `drone.gimbal[0]` are the states of the main camera and gimbal.
- A coroutine returns when the drone has confirmed. A method without `async` sends and returns at once.
- Each method that sends raises `LinkLost` without a link and `NotSupported` for what the drone does not have. Each that
  waits raises `CommandTimeout` when the drone does not confirm in time.

## connect

```python
{connect}
```

{connect_doc}
"""

EVENTS = """
## events

`anafi_mav.drone.events` has Parrot's own names: the enums that occur in states and verbs, and the messages that
`Drone.subscribe` and `Drone.expect` deliver. Their fields are those of Parrot's protocol.

{names}
"""


def python_api() -> str:
    """docs/python-api-reference.md."""
    from api_reference import body, function

    from anafi_mav import drone

    signature, doc = function("connect", drone.connect)
    head = PYTHON_API.format(connect=signature, connect_doc=doc)
    names = ", ".join(f"`{name}`" for name in drone.events.__all__)
    return head + body() + EVENTS.format(names=names)


TEXTS = """\
# Texts for the pilot

<!-- Made by docs/generate.py from anafi_mav/texts.py. -->

For people who read a text in their ground station, or write a program that recognises one. After reading you know
every text that the gateway sends as STATUSTEXT, and the reasons in it. What to do
about one is in [troubleshooting](troubleshooting.md).

- `{name}` stands for a value. `{reason}` is one of the reasons below, or what a lower layer reports.
- A refusal is `{what} refused: {reason}`, a WARNING to every client. A refused motor cut is CRITICAL. Refusals of
  streamed inputs are sent to their sender alone ([dropped-inputs](dropped-inputs.md)).
- A text that names a file or quotes an explanation may be longer than 50 bytes. It then takes several messages.
- Without a severity, a text is a part of another one, or its severity depends on the situation.
"""

_SENT = re.compile(r"Severity\.(\w+),\s*texts\.([A-Z]\w+)")
_THROTTLED = re.compile(r"warn_throttled\(\s*texts\.([A-Z]\w+)")


def _severities() -> dict[str, set[str]]:
    """The severities of each text by its name, where the code names both together."""
    found: dict[str, set[str]] = {}
    for path in sorted((HERE.parent / "anafi_mav").rglob("*.py")):
        code = path.read_text(encoding="utf-8")
        for severity, name in _SENT.findall(code):
            found.setdefault(name, set()).add(severity)
        for name in _THROTTLED.findall(code):
            found.setdefault(name, set()).add("WARNING")
    return found


def operator_texts() -> str:
    """The page of all texts."""
    from anafi_mav import texts

    severities, page = _severities(), TEXTS
    for line in Path(texts.__file__).read_text(encoding="utf-8").splitlines():
        if heading := re.fullmatch(r"# == (.*) ==", line):
            page += f"\n## {heading[1]}\n\n| text | severity |\n|---|---|\n"
        elif assigned := re.match(r"([A-Z]\w+) = ", line):
            entry = getattr(texts, assigned[1])
            if isinstance(entry, texts.OperatorText | texts.Template):
                text = (
                    entry if isinstance(entry, texts.OperatorText) else re.sub(r"(\{\w+)[^}]*\}", r"\1}", entry.pattern)
                )
                page += f"| `{text}` | {', '.join(sorted(severities.get(assigned[1], ())))} |\n"
    return page


DROPPED_INPUTS = """\
# Inputs that are not flown

<!-- Made by docs/generate.py from anafi_mav/services/dropped_inputs.py. -->

For programmers who stream setpoints, sticks, targets or gimbal rates. After reading you know each reason for which such
an input is not flown, and its text. A command is answered by its COMMAND_ACK instead; one that is refused because
another station is the [operator](security.md#operator-control) gets the text of the last table besides.

- Only the channel of the sender receives the text. The gateway's terminal shows it with the sender's system id.
- One text for each reason and episode, at most one in {every:g} s for each sender and reason. An episode ends when an
  input of the same stream is flown, or when none has been dropped for this reason for {gap:g} s.
- A NOTICE is sent after {grace:g} s, all others are WARNINGs and are sent at once.
- The gateway remembers {senders} senders.

Not reported are:

- centred sticks, zero rates of a gimbal, and a throttle that rests where it was in the first message;
- setpoints without motion from a client of PX4 that has not chosen Offboard;
- targets while the mode is not Follow: their message names no drone;
- an input that a newer one of the same sender has replaced, and a setpoint that waits for the end of a take-off.
"""


def dropped_inputs() -> str:
    """The page of all causes for which an input is not flown."""
    from anafi_mav import texts
    from anafi_mav.services import dropped_inputs as table

    parts = [
        DROPPED_INPUTS.format(
            every=table.REPORT_EVERY, gap=table.EPISODE_GAP, grace=table.MODE_GRACE, senders=table.MAX_SENDERS
        )
    ]
    for stream in table.InputStream:
        parts.append(f"\n## {stream.value}\n\n| text | severity |\n|---|---|\n")
        for cause in table.CAUSES:
            if cause.stream is stream:
                reason = "{reason of the drone}" if cause.reason is None else cause.reason.pattern
                text = re.sub(r"(\{[\w ]+)[^}]*\}", r"\1}", cause.text(texts.from_below(reason)))
                parts.append(f"| `{text}` | {cause.severity.name} |\n")
    return "".join(parts)


PAGES: dict[str, Callable[[], str]] = {
    "camera.md": camera,
    "camera-settings.md": camera_settings,
    "commands.md": commands,
    "configuration.md": configuration,
    "dialect.md": dialect,
    "dropped-inputs.md": dropped_inputs,
    "parameters.md": parameters,
    "plan-translation.md": plan_translation,
    "python-api-reference.md": python_api,
    "seed.md": seed,
    "seed-mavlink.md": seed_mavlink,
    "silence.md": silence,
    "states.md": states,
    "texts.md": operator_texts,
}


def main(arguments: list[str]) -> int:
    stale = [name for name, page in PAGES.items() if _read(HERE / name) != page()]
    for name in stale:
        if "--check" in arguments:
            sys.stderr.write(f"docs/{name} is stale: run python docs/generate.py\n")
        else:
            (HERE / name).write_text(PAGES[name](), encoding="utf-8")
    return 1 if stale and "--check" in arguments else 0


def _read(path: Path) -> str | None:
    return path.read_text(encoding="utf-8") if path.exists() else None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
