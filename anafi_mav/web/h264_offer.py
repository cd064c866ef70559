"""Offers of browsers, reduced to the one codec that fits the drone's pictures. No I/O.

An offer (SDP, RFC 8866) lists what a browser decodes. What stays of it is one payload type of H.264 and its
retransmissions. The browser's own addresses are removed: it connects to the gateway, never the other way round, so that
a page cannot make the gateway send anything to an address that the page names.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from anafi_mav.errors import AnafiMavError

PLAIN_PROFILE = "42e01f"
"""Constrained baseline, level 3.1: what the WebRTC library calls the codec, whatever its profile is."""

MAX_LINES = 2000
"""Of an offer. Chromium's has 150."""

_PROTOCOL = "UDP/TLS/RTP/SAVPF"
_BASELINE, _MAIN, _HIGH, _HIGH_10, _HIGH_422, _HIGH_444 = 66, 77, 100, 110, 122, 244
"""profile_idc (H.264 A.2)."""
_CONSTRAINED = 0
"""In place of profile_idc for constrained baseline, which is `_BASELINE` with constraint_set1_flag."""
_SET_1 = 0x40

_BEYOND_MAIN = (_HIGH, _HIGH_10, _HIGH_422, _HIGH_444)
DECODERS: Final = {
    _CONSTRAINED: (_CONSTRAINED, _BASELINE, _MAIN, *_BEYOND_MAIN),
    _BASELINE: (_BASELINE,),
    _MAIN: (_MAIN, *_BEYOND_MAIN),
    _HIGH: _BEYOND_MAIN,
}
"""Profile of a stream: the profiles whose decoders show it, the stream's own first (H.264 A.2)."""


class OfferError(AnafiMavError):
    """An offer that cannot be answered; the text says why."""


class ReducedOffer(NamedTuple):
    """One codec of an offer."""

    sdp: str
    profile: str
    """profile-level-id for the answer: the stream's own, or that of the decoder which shows it."""


class _Codec(NamedTuple):
    payload_type: str
    profile: str


def reduce_offer(offer: str, sps: bytes) -> ReducedOffer:
    """Return the offer with the codec that shows a stream with these sequence parameters.

    Empty `sps`: not known, constrained baseline is assumed. Raises `OfferError`.
    """
    lines = offer.splitlines()
    if len(lines) > MAX_LINES:
        raise OfferError("the offer is too long")
    media = [line for line in lines if line.startswith("m=")]
    if len(media) != 1 or not media[0].startswith("m=video "):
        raise OfferError("expected an offer of one video section")
    parts = media[0].split()
    if len(parts) < 4 or parts[2] != _PROTOCOL:
        raise OfferError(f"expected {_PROTOCOL}")
    if "a=sendonly" in lines or "a=inactive" in lines:
        raise OfferError("expected an offer to receive")
    if not any(line.startswith("a=fingerprint:") for line in lines):
        raise OfferError("expected the fingerprint of a certificate")
    stream = f"{sps[1]:02x}{sps[2]:02x}{sps[3]:02x}" if len(sps) > 3 else PLAIN_PROFILE
    codec = _choose(_codecs(lines, parts[3:]), stream)
    again = _retransmission(lines, codec.payload_type)
    kept = {codec.payload_type} | ({again} if again else set())
    reduced = [
        f"a=fmtp:{codec.payload_type} level-asymmetry-allowed=1;packetization-mode=1;profile-level-id={PLAIN_PROFILE}"
    ]
    if again:
        reduced.append(f"a=fmtp:{again} apt={codec.payload_type}")
    lines = [line for line in lines if _is_kept(line, kept)]
    place = next(number for number, line in enumerate(lines) if line.startswith("m="))
    lines[place] = " ".join([*parts[:3], *(one for one in parts[3:] if one in kept)])
    own = _kind(codec.profile) == _kind(stream)
    return ReducedOffer("\r\n".join([*lines, *reduced, ""]), stream if own else codec.profile)


def finish_answer(answer: str, profile: str) -> str:
    """Return an answer to a reduced offer with the real profile."""
    return answer.replace(f"profile-level-id={PLAIN_PROFILE}", f"profile-level-id={profile}")


def _choose(codecs: list[_Codec], stream: str) -> _Codec:
    wanted = DECODERS.get(_kind(stream), (_kind(stream),))
    for kind in wanted:
        for codec in codecs:
            if _kind(codec.profile) == kind:
                return codec
    offered = ", ".join(sorted({codec.profile for codec in codecs})) or "none"
    raise OfferError(f"the picture is H.264 of profile {stream}, this browser offers {offered}")


def _kind(profile: str) -> int:
    idc, constraints = int(profile[:2], 16), int(profile[2:4], 16)
    return _CONSTRAINED if idc == _BASELINE and constraints & _SET_1 else idc


def _codecs(lines: list[str], payload_types: list[str]) -> list[_Codec]:
    """Return the H.264 codecs of an offer that take fragments (packetization-mode 1)."""
    h264 = {
        _payload_type(line)
        for line in lines
        if line.startswith("a=rtpmap:") and line.partition(" ")[2].strip().upper() == "H264/90000"
    }
    codecs = []
    for line in lines:
        payload_type = _payload_type(line)
        if line.startswith("a=fmtp:") and payload_type in h264 and payload_type in payload_types:
            options = _options(line)
            profile = options.get("profile-level-id", "42000a").lower()
            if options.get("packetization-mode") == "1" and len(profile) == 6 and _is_hex(profile):
                codecs.append(_Codec(payload_type, profile))
    return codecs


def _retransmission(lines: list[str], payload_type: str) -> str | None:
    """Return the payload type of a codec's retransmissions (RFC 4588), or None."""
    for line in lines:
        if line.startswith("a=fmtp:") and _options(line).get("apt") == payload_type:
            again = _payload_type(line)
            if again != payload_type and any(other.lower() == f"a=rtpmap:{again} rtx/90000" for other in lines):
                return again
    return None


def _is_kept(line: str, kept: set[str]) -> bool:
    if line.startswith(("a=candidate:", "a=end-of-candidates", "a=fmtp:")) or not line:
        return False
    return not line.startswith(("a=rtpmap:", "a=rtcp-fb:")) or _payload_type(line) in kept


def _payload_type(line: str) -> str:
    return line.partition(":")[2].partition(" ")[0]


def _options(line: str) -> dict[str, str]:
    pairs = (option.partition("=") for option in line.partition(" ")[2].split(";"))
    return {name.strip(): value.strip() for name, _, value in pairs}


def _is_hex(text: str) -> bool:
    return all(letter in "0123456789abcdef" for letter in text)
