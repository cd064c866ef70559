"""Digest authentication of viewers by the gateway's token (RFC 2326 D, RFC 7616). No I/O.

The token itself never travels. Each connection has a nonce of its own, so that nothing recorded on another one counts.
The hash is MD5, the only one that players know (ffmpeg's httpauth.c, GStreamer's gstrtspconnection.c, live555); with a
token of 256 random bits its weaknesses are of no use. Answers without `qop` are accepted, because live555 and GStreamer
send those. The user name may be anything: the token is the secret.
"""

from __future__ import annotations

import hashlib
import hmac
import re

from anafi_mav.access_token import AccessToken

REALM = "anafi-mav"

_PARAMETER = re.compile(r'(?<![a-z])([a-z]+) *= *(?:"([^"\\]*)"|([^\s",]+))', re.IGNORECASE)
"""Of an Authorization header. A quoted text with an escaped sign is none that we read: no client sends one."""


class DigestChallenge:
    """The challenge of one connection, and the judge of the answers to it."""

    def __init__(self, token: AccessToken, nonce: str, realm: str = REALM) -> None:
        self._token = token
        self._nonce = nonce
        self._realm = realm

    @property
    def header(self) -> tuple[str, str]:
        """The header of a refusal."""
        return "WWW-Authenticate", f'Digest realm="{self._realm}", nonce="{self._nonce}", algorithm=MD5, qop="auth"'

    def admits(self, method: str, uri: str, authorization: str | None) -> bool:
        """True when the Authorization header of a request proves that its sender has the token.

        Its URI may be the beginning of the request's: live555 signs a track's requests with the stream's URI.
        """
        scheme, _, rest = (authorization or "").strip().partition(" ")
        if scheme.lower() != "digest":
            return False
        given = {name.lower(): quoted or plain for name, quoted, plain in _PARAMETER.findall(rest)}
        signed, qop = given.get("uri", ""), given.get("qop", "")
        if (
            given.get("realm") != self._realm
            or not _equal(given.get("nonce", ""), self._nonce)
            or given.get("algorithm", "MD5").upper() != "MD5"
            or not _begins(uri, signed)
            or qop not in ("", "auth")
        ):
            return False
        middle = [self._nonce, given.get("nc", ""), given.get("cnonce", ""), qop] if qop else [self._nonce]
        secret = _md5(given.get("username", ""), self._realm, self._token.text)
        return _equal(given.get("response", "").lower(), _md5(secret, *middle, _md5(method, signed)))


def _begins(uri: str, signed: str) -> bool:
    """True when `signed` is the URI, or a part of its path from the beginning on."""
    return bool(signed) and f"{uri.rstrip('/')}/".startswith(f"{signed.rstrip('/')}/")


def _equal(given: str, expected: str) -> bool:
    """Compare in a time that does not depend on the texts."""
    return hmac.compare_digest(given.encode(), expected.encode())


def _md5(*parts: str) -> str:
    return hashlib.md5(":".join(parts).encode(), usedforsecurity=False).hexdigest()
