"""A viewer's requests: which are valid when, and what is answered."""

from __future__ import annotations

import random

import pytest

from anafi_mav.access_token import AccessToken
from anafi_mav.arsdk.video.rtsp import METHODS, Response, RtspRequest, RtspTransport, Status, encode
from anafi_mav.relay.dialogue import (
    PUBLIC,
    TRANSITIONS,
    DialogueState,
    ViewerAction,
    ViewerDialogue,
    ViewerRequest,
    stream_path,
)
from anafi_mav.relay.digest import DigestChallenge

CHALLENGE = DigestChallenge(AccessToken("secret"), "0123")

URL = "rtsp://127.0.0.1:8555/1/visible"
UDP = "RTP/AVP;unicast;client_port=5000-5001"


def request(method: str, uri: str = URL, **headers: str) -> RtspRequest:
    return RtspRequest(method, uri, (("CSeq", "3"), *headers.items()))


def refused(judged: ViewerRequest) -> int:
    assert judged.action is ViewerAction.ANSWER
    assert judged.response is not None
    assert judged.response.cseq == 3
    return judged.response.status


def in_state(state: DialogueState, challenge: DigestChallenge | None = None) -> ViewerDialogue:
    dialogue = ViewerDialogue("S1", challenge=challenge)
    if state is not DialogueState.INIT:
        dialogue.set_up(request("SETUP", URL + "/video", Transport=UDP), RtspTransport())
    if state is DialogueState.PLAYING:
        dialogue.playing(request("PLAY", Session="S1"), None)
    return dialogue


def test_session_from_beginning_to_end() -> None:
    dialogue = ViewerDialogue("S1", 60)
    options = dialogue.judge(request("OPTIONS"))
    assert options.response == Response(200, (("CSeq", "3"), ("Server", "anafi-mav"), ("Public", PUBLIC)))
    describe = dialogue.judge(request("DESCRIBE"))
    assert (describe.action, describe.path) == (ViewerAction.DESCRIBE, ("1", "visible"))
    described = dialogue.described(describe.request, b"v=0\r\n")
    assert (described.header("Content-Base"), described.body) == (URL + "/", b"v=0\r\n")
    setup = dialogue.judge(request("SETUP", URL + "/video", Transport=UDP))
    assert (setup.action, setup.path) == (ViewerAction.SETUP, ("1", "visible"))
    assert setup.offers == (RtspTransport(client_ports=(5000, 5001)),)
    answer = dialogue.set_up(setup.request, RtspTransport(client_ports=(5000, 5001), server_ports=(6000, 6001)))
    assert answer.header("Session") == "S1;timeout=60"
    assert answer.header("Transport") == "RTP/AVP/UDP;unicast;client_port=5000-5001;server_port=6000-6001"
    play = dialogue.judge(request("PLAY", Session="S1"))
    assert play.action is ViewerAction.PLAY
    playing = dialogue.playing(play.request, (7, 90000))
    assert playing.header("RTP-Info") == f"url={URL}/video;seq=7;rtptime=90000"
    assert dialogue.judge(request("GET_PARAMETER", Session="S1")).response is not None
    pause = dialogue.judge(request("PAUSE", Session="S1"))
    assert pause.action is ViewerAction.PAUSE
    dialogue.done(pause.request)
    assert dialogue.state is DialogueState.READY
    dialogue.done(dialogue.judge(request("TEARDOWN", Session="S1")).request)
    assert dialogue.state is DialogueState.INIT


@pytest.mark.parametrize("state", DialogueState)
@pytest.mark.parametrize("method", ["SETUP", "PLAY", "PAUSE", "TEARDOWN"])
def test_method_is_valid_in_its_states_only(state: DialogueState, method: str) -> None:
    dialogue = in_state(state)
    session = {} if state is DialogueState.INIT else {"Session": "S1"}
    judged = dialogue.judge(request(method, Transport=UDP, **session))
    if method in TRANSITIONS[state]:
        assert judged.action.name == method
    else:
        expected = Status.SESSION_NOT_FOUND if state is DialogueState.INIT else Status.METHOD_NOT_VALID
        assert refused(judged) == expected


def test_request_for_another_session_is_refused() -> None:
    for state in DialogueState:
        for method in ("GET_PARAMETER", "PLAY", "SETUP", "TEARDOWN"):
            judged = in_state(state).judge(request(method, Session="S2", Transport=UDP))
            assert refused(judged) == Status.SESSION_NOT_FOUND
    assert refused(in_state(DialogueState.READY).judge(request("PLAY"))) == Status.SESSION_NOT_FOUND
    assert refused(in_state(DialogueState.INIT).judge(request("OPTIONS", Session="S1"))) == Status.SESSION_NOT_FOUND


def test_unknown_methods_and_missing_numbers_are_refused() -> None:
    dialogue = ViewerDialogue("S1")
    assert refused(dialogue.judge(request("ANNOUNCE"))) == Status.METHOD_NOT_ALLOWED
    assert refused(dialogue.judge(request("HELLO"))) == Status.NOT_IMPLEMENTED
    assert refused(dialogue.judge(request("DESCRIBE", "rtsp://a/" + "b" * 1000))) == Status.URI_TOO_LARGE
    judged = dialogue.judge(RtspRequest("OPTIONS", "*"))
    assert judged.response is not None
    assert judged.response.status == Status.BAD_REQUEST


@pytest.mark.parametrize(
    ("header", "offers"),
    [
        ("RTP/AVP/TCP;unicast;interleaved=0-1", [RtspTransport(lower="TCP", channels=(0, 1))]),
        ("RTP/AVP/TCP", [RtspTransport(lower="TCP", channels=(0, 1))]),
        ("RTP/AVP;unicast;destination=10.0.0.9;client_port=5000-5001", [RtspTransport(client_ports=(5000, 5001))]),
        ("RTP/AVP;multicast;port=5000, RTP/AVP/TCP;interleaved=4-5", [RtspTransport(lower="TCP", channels=(4, 5))]),
        ("RTP/AVP;multicast", []),
        ("RTP/AVP;unicast", []),
        ("RTP/SAVP;unicast;client_port=5000-5001", []),
        ("", []),
    ],
)
def test_transport_is_udp_to_the_viewer_or_inside_its_connection(header: str, offers: list[RtspTransport]) -> None:
    judged = ViewerDialogue("S1").judge(request("SETUP", Transport=header))
    if offers:
        assert list(judged.offers) == offers
    else:
        assert refused(judged) == Status.UNSUPPORTED_TRANSPORT


@pytest.mark.parametrize(
    ("uri", "path"),
    [
        (URL, ("1", "visible")),
        (URL + "/", ("1", "visible")),
        (URL + "/video", ("1", "visible")),
        (URL + "?x=1", ("1", "visible")),
        ("rtsp://[::1]:8555/alpha/thermal", ("alpha", "thermal")),
        ("rtsp://user:secret@host/1/visible", ("1", "visible")),
        ("rtsp://host", ()),
        ("rtsp://host/" + "a" * 257, ()),
        ("http://host/1/visible", ()),
        ("*", ()),
    ],
)
def test_path_names_system_and_stream(uri: str, path: tuple[str, ...]) -> None:
    assert stream_path(uri) == path


def test_reason_of_a_refusal_is_one_line() -> None:
    answer = ViewerDialogue("S1").refused(request("DESCRIBE"), Status.SERVICE_UNAVAILABLE, "no\r\nX: picture")
    assert encode(answer).startswith(b"RTSP/1.0 503 no X: picture\r\nCSeq: 3\r\n")


def test_noise_in_requests_never_raises() -> None:
    generator = random.Random(3)
    letters = "abcRTP/AVP;=,-0123456789 \"'%[]:"
    for _ in range(2000):
        text = ["".join(generator.choices(letters, k=generator.randrange(30))) for _ in range(4)]
        dialogue = in_state(generator.choice(list(DialogueState)))
        headers = (("CSeq", "1"), ("Session", generator.choice(["S1", text[0]])), ("Transport", text[1]))
        dialogue.judge(RtspRequest(generator.choice(METHODS), "rtsp://h/" + text[2], headers))


@pytest.mark.parametrize("state", DialogueState)
@pytest.mark.parametrize("method", PUBLIC.split(", "))
@pytest.mark.parametrize("authorization", [None, "Digest x", "Basic dmlld2VyOnNlY3JldA=="])
def test_request_without_the_token_is_challenged_in_each_state(
    state: DialogueState, method: str, authorization: str | None
) -> None:
    dialogue = in_state(state, CHALLENGE)
    headers = {"Transport": UDP}
    if state is not DialogueState.INIT:
        headers["Session"] = "S1"
    if authorization is not None:
        headers["Authorization"] = authorization
    judged = dialogue.judge(request(method, **headers))
    assert judged.action is ViewerAction.ANSWER
    assert judged.response is not None
    if method == "OPTIONS":
        assert judged.response.status == Status.OK
    else:
        assert judged.response.status == Status.UNAUTHORIZED
        assert judged.response.header("WWW-Authenticate") == CHALLENGE.header[1]
    assert (dialogue.state, dialogue.is_admitted) == (state, False)
