"""Digest authentication of viewers: the RFC's example, players' dialects, and everything that is refused."""

from __future__ import annotations

import pytest

from anafi_mav.access_token import AccessToken
from anafi_mav.relay.digest import REALM, DigestChallenge

RFC = DigestChallenge(AccessToken("Circle Of Life"), "dcd98b7102dd2f0e8b11d0f600bfb0c093", "testrealm@host.com")
"""The secret of the example in RFC 2617 3.5."""

EXAMPLE = (
    'Digest username="Mufasa", realm="testrealm@host.com", nonce="dcd98b7102dd2f0e8b11d0f600bfb0c093", '
    'uri="/dir/index.html", qop=auth, nc=00000001, cnonce="0a4f113b", response="6629fae49393a05397450978507c4ef1", '
    'opaque="5ccc069c403ebaf9f0171e9517f40e41"'
)

OLD = (
    'Digest username="Mufasa", realm="testrealm@host.com", nonce="dcd98b7102dd2f0e8b11d0f600bfb0c093", '
    'uri="/dir/index.html", response="670fd8c2df070c60b045671b8b24ff02"'
)
"""The same without qop; the response was calculated with md5sum."""


@pytest.mark.parametrize(
    "header", [EXAMPLE, OLD, EXAMPLE.replace("6629fae49", "6629FAE49"), EXAMPLE.replace(", ", " , ")]
)
def test_right_answer_is_admitted(header: str) -> None:
    assert RFC.admits("GET", "/dir/index.html", header)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Digest ", "Basic "),
        ("Digest ", ""),
        ("Mufasa", "mufasa"),
        ("testrealm@", "realm@"),
        ("dcd98b", "dcd98c"),
        ("00000001", "00000002"),
        ("0a4f113b", "0a4f113c"),
        ("qop=auth", "qop=auth-int"),
        ("qop=auth, ", ""),
        ("6629fae49", "6629fae48"),
        ("6629fae49393a05397450978507c4ef1", ""),
        ("6629fae49393a05397450978507c4ef1", "6629fae4\u00e9"),
        ("opaque=", "algorithm=SHA-256, opaque="),
        ("opaque=", "algorithm=MD5-sess, opaque="),
        ('uri="/dir/index.html", ', ""),
        ("/dir/index.html", "/dir/index"),
        ("username=", "name="),
    ],
)
def test_wrong_answer_is_refused(old: str, new: str) -> None:
    assert old in EXAMPLE
    assert not RFC.admits("GET", "/dir/index.html", EXAMPLE.replace(old, new))


def test_answer_for_another_request_is_refused() -> None:
    assert not RFC.admits("POST", "/dir/index.html", EXAMPLE)
    assert not RFC.admits("GET", "/dir/index.html2", EXAMPLE)
    assert not RFC.admits("GET", "/dir", EXAMPLE)
    assert not RFC.admits("GET", "/dir/index.html", None)


def test_answer_for_the_stream_counts_for_its_track() -> None:
    """live555 signs so."""
    assert RFC.admits("GET", "/dir/index.html/video", EXAMPLE)


@pytest.mark.parametrize(
    "text", ["a" * 8000, "a=" * 4000, 'a="' * 2001, "a " * 4000, "=" * 8000, '"' * 8001, "a" + " " * 8000]
)
def test_hostile_header_is_refused(text: str) -> None:
    assert not RFC.admits("GET", "/dir/index.html", f"Digest {text}")


def test_challenge_names_realm_nonce_and_hash() -> None:
    name, value = DigestChallenge(AccessToken("secret"), "0123").header
    assert (name, value) == ("WWW-Authenticate", f'Digest realm="{REALM}", nonce="0123", algorithm=MD5, qop="auth"')
