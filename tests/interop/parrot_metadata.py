"""Parrot's libvideo-metadata as a process: reads and writes the metadata of pictures.

One JSON object per line on stdin: ``{"format": "v3"|"proto", "hex": "..."}``. On stdout the same metadata as Parrot
reads it, with ``"hex"`` its own protocol buffer of it; ``{"refused": errno}`` if it does not.
"""

from __future__ import annotations

import ctypes
import json
import sys
from typing import Any

import olympe_deps as parrot

PROTO_TYPE = b"application/octet-stream;type=com.parrot.videometadataproto"


def read(order: dict[str, str]) -> dict[str, Any]:
    data = bytes.fromhex(order["hex"])
    held = (ctypes.c_ubyte * max(len(data), 1)).from_buffer_copy(data or b"\0")
    # struct vmeta_buffer {uint8_t *data; size_t len; size_t pos;}
    words = (ctypes.c_uint64 * 3)(ctypes.addressof(held), len(data), 0)
    buffer = ctypes.cast(words, ctypes.POINTER(parrot.struct_vmeta_buffer))
    kind = ctypes.create_string_buffer(PROTO_TYPE) if order["format"] == "proto" else None
    frame = ctypes.POINTER(parrot.struct_vmeta_frame)()
    mime = ctypes.cast(kind, ctypes.POINTER(ctypes.c_char)) if kind else None
    result = parrot.vmeta_frame_read2(buffer, mime, 1, ctypes.byref(frame))
    if result != 0:
        return {"refused": -result}
    text = ctypes.create_string_buffer(1 << 16)
    result = parrot.vmeta_frame_to_json_str(frame, text, len(text))
    if result < 0:
        return {"refused": -result}
    answer: dict[str, Any] = json.loads(text.value)
    packed, size = ctypes.POINTER(ctypes.c_ubyte)(), ctypes.c_uint64()
    result = parrot.vmeta_frame_proto_get_buffer(frame, ctypes.byref(packed), ctypes.byref(size))
    if result == 0:
        answer["hex"] = bytes(packed[: size.value]).hex()
    return answer


def main() -> None:
    for line in sys.stdin:
        sys.stdout.write(json.dumps(read(json.loads(line))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
