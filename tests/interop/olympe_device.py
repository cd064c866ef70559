"""Parrot's own device role (Olympe's `DeviceBase`) as a process, in a network namespace of its own.

libarsdk listens on fixed ports of all addresses, hence the namespace: nothing of the machine is in its way.
One JSON object per line: on stdin ``{"send": name, "args": [...]}``, on stdout ``{"ready": true}``, then
``{"received": name, "args": [...]}`` for each message that came. Enums and bitfields travel as integers, binaries as
``{"hex": "..."}``; of a received protobuf message there are the names of its fields instead. What is sent comes
back as received. Ends with stdin. Exit status 77: the system does not let us make a namespace.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import socket
import struct
import sys
import threading

CLONE_NEWNET = 0x40000000
SIOCSIFFLAGS = 0x8914
IFF_UP_RUNNING = 0x41


def enter_own_network() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0:
        sys.exit(77)
    with socket.socket() as sock:
        fcntl.ioctl(sock.fileno(), SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", IFF_UP_RUNNING))


def main() -> None:
    enter_own_network()
    # Olympe starts threads when it is imported; they have to be born in the namespace.
    import olympe.log
    import olympe_deps
    from olympe.controllers.device import DeviceBase
    from olympe.messaging.arsdk_enums import ArsdkBitfield, ArsdkEnum

    # Its log goes to stdout otherwise, between our lines.
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    olympe.log.update_config({"loggers": {"olympe": {"level": "ERROR"}}})
    lock = threading.Lock()

    def say(**members: object) -> None:
        with lock:
            print(json.dumps(members), file=out)

    def plain(value: object) -> object:
        if isinstance(value, ArsdkEnum):
            return value._value_
        if isinstance(value, ArsdkBitfield):
            return value.to_int()
        if isinstance(value, bytes | bytearray | list | tuple):
            return {"hex": bytes(value).hex()}
        return value

    def heard(event: object, scheduler: object) -> None:
        if hasattr(event, "message") and hasattr(event.message, "service_proto"):
            # A protobuf message; that it is read as what was meant is compared without a network.
            say(received=event.message.fullName, args=sorted(event.args))
        elif hasattr(event, "message"):
            say(received=event.message.fullName, args=[plain(value) for value in event.args.values()])
        elif hasattr(event, "payload"):
            say(received=type(event).__name__, args=[plain(event.payload)])

    device = DeviceBase(name="referee", drone_type=olympe_deps.ARSDK_DEVICE_TYPE_ANAFI4K)
    device.subscribe(heard, None)
    if not device.listen().result_or_cancel(timeout=5):
        sys.exit("Olympe does not listen")
    names = {message.fullName: message for message in device.messages.values()}
    say(ready=True)
    for line in sys.stdin:
        order = json.loads(line)
        message = names[order["send"]]
        args = [bytearray.fromhex(value["hex"]) if isinstance(value, dict) else value for value in order["args"]]
        # Olympe adds a `list_flags` of its own to items of lists that have none on the wire; it is not encoded.
        args += [0] * (len(message.args_name) - len(message.obj.args))
        device._send_command_raw(message, dict(zip(message.args_name, args, strict=True)), quiet=True)
    # Olympe's own way out takes seconds and is not what is tested here.
    os._exit(0)


if __name__ == "__main__":
    main()
