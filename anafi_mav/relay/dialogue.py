"""One viewer's RTSP connection: valid requests and their responses. No I/O.

`judge` takes a request and returns what is to be done for it; the response is made when that is done. A connection has
one session at most, which ends with it, and a session has one stream: each stream is its own URI.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

from anafi_mav.arsdk.video import rtsp
from anafi_mav.arsdk.video.rtsp import Headers, Response, RtpInfo, RtspRequest, RtspTransport, Status
from anafi_mav.relay.digest import DigestChallenge

SERVER = "anafi-mav"

SESSION_TIMEOUT = 60
"""s without a request or report of a viewer after which its session ends (RTSP's own default)."""

CONTROL = "video"
"""Last part of the URL of a stream's only track."""

PUBLIC = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, TEARDOWN, GET_PARAMETER, SET_PARAMETER"

MAX_PATH = 256
"""Characters of a path; the longest of ours has 45."""


class DialogueState(enum.Enum):
    """State of the session (RFC 2326 A.2)."""

    INIT = "no session"
    READY = "a transport is set up"
    PLAYING = "pictures are sent"


TRANSITIONS: dict[DialogueState, dict[str, DialogueState]] = {
    DialogueState.INIT: {"SETUP": DialogueState.READY},
    DialogueState.READY: {
        "SETUP": DialogueState.READY,
        "PLAY": DialogueState.PLAYING,
        "PAUSE": DialogueState.READY,
        "TEARDOWN": DialogueState.INIT,
    },
    DialogueState.PLAYING: {
        "PLAY": DialogueState.PLAYING,
        "PAUSE": DialogueState.READY,
        "TEARDOWN": DialogueState.INIT,
    },
}
"""State → method → next state. A method that is missing is not valid in that state."""


class ViewerAction(enum.Enum):
    """Work of the shell for a request."""

    ANSWER = "nothing"
    DESCRIBE = "describe the stream"
    SETUP = "set up a transport"
    PLAY = "send pictures"
    PAUSE = "send none for now"
    TEARDOWN = "end the session"


_ACTIONS = {
    "DESCRIBE": ViewerAction.DESCRIBE,
    "SETUP": ViewerAction.SETUP,
    "PLAY": ViewerAction.PLAY,
    "PAUSE": ViewerAction.PAUSE,
    "TEARDOWN": ViewerAction.TEARDOWN,
}


@dataclass(frozen=True)
class ViewerRequest:
    """A valid request, and what is to be done for it; or the response to an invalid one."""

    action: ViewerAction
    request: RtspRequest
    path: tuple[str, ...] = ()
    """Of the stream, without the track."""
    offers: tuple[RtspTransport, ...] = ()
    """Usable transports of a SETUP, best first."""
    response: Response | None = None
    """Of an ANSWER."""


class ViewerDialogue:
    """The requests of one connection."""

    def __init__(self, session: str, timeout: int = SESSION_TIMEOUT, challenge: DigestChallenge | None = None) -> None:
        """`session` is the id of the session that the viewer may set up.

        With a `challenge` each request but OPTIONS has to prove that its sender has the token.
        """
        self.state = DialogueState.INIT
        self.is_admitted = challenge is None
        """A request of this viewer has passed the challenge."""
        self._challenge = challenge
        self._session = session
        self._timeout = timeout
        self._url = ""
        """Of the track, as the viewer wrote it."""

    def judge(self, request: RtspRequest) -> ViewerRequest:
        """Return what is to be done for a request."""
        refusal = self._refusal(request)
        if refusal is not None:
            return ViewerRequest(ViewerAction.ANSWER, request, response=refusal)
        action = _ACTIONS.get(request.method)
        if action is None:
            headers = (("Public", PUBLIC),) if request.method == "OPTIONS" else ()
            more = (self._session_header(),) if self.state is not DialogueState.INIT else ()
            return ViewerRequest(ViewerAction.ANSWER, request, response=self._response(request, (*headers, *more)))
        path = stream_path(request.uri)
        offers: tuple[RtspTransport, ...] = ()
        if action is ViewerAction.SETUP:
            offers = _usable(request.header("Transport") or "")
            if not offers:
                return self._refused_now(request, Status.UNSUPPORTED_TRANSPORT)
        return ViewerRequest(action, request, path, offers)

    def _refusal(self, request: RtspRequest) -> Response | None:
        known = request.method in _ACTIONS or request.method in PUBLIC.split(", ")
        if request.cseq is None:
            return self._response(request, (), Status.BAD_REQUEST)
        if not known:
            status = Status.METHOD_NOT_ALLOWED if request.method in rtsp.METHODS else Status.NOT_IMPLEMENTED
            return self._response(request, (("Allow", PUBLIC),), status)
        if len(request.uri) > MAX_PATH + 256:
            return self._response(request, (), Status.URI_TOO_LARGE)
        if self._challenge is not None and request.method != "OPTIONS":
            if not self._challenge.admits(request.method, request.uri, request.header("Authorization")):
                return self._response(request, (self._challenge.header,), Status.UNAUTHORIZED)
            self.is_admitted = True
        session = request.header("Session")
        named = session is not None and rtsp.parse_session(session)[0] == self._session
        if session is not None and (not named or self.state is DialogueState.INIT):
            return self._response(request, (), Status.SESSION_NOT_FOUND)
        if request.method not in ("OPTIONS", "DESCRIBE", "GET_PARAMETER", "SET_PARAMETER"):
            if request.method not in TRANSITIONS[self.state]:
                missing = self.state is DialogueState.INIT
                status = Status.SESSION_NOT_FOUND if missing else Status.METHOD_NOT_VALID
                return self._response(request, (), status)
            if request.method != "SETUP" and not named:
                return self._response(request, (), Status.SESSION_NOT_FOUND)
        return None

    def _refused_now(self, request: RtspRequest, status: Status) -> ViewerRequest:
        return ViewerRequest(ViewerAction.ANSWER, request, response=self._response(request, (), status))

    # -- responses

    def refused(self, request: RtspRequest, status: Status, reason: str = "") -> Response:
        """Return the response to a request that could not be done; `reason` is one line for people."""
        return self._response(request, (), status, reason=" ".join(reason.split()))

    def described(self, request: RtspRequest, description: bytes) -> Response:
        """Return the response with the description of a stream."""
        base = request.uri.rstrip("/") + "/"
        headers = (("Content-Base", base), ("Content-Type", "application/sdp"), ("Cache-Control", "no-cache"))
        return self._response(request, headers, body=description)

    def set_up(self, request: RtspRequest, transport: RtspTransport) -> Response:
        """Return the response to a SETUP whose transport is ready."""
        self.state = TRANSITIONS[self.state]["SETUP"]
        self._url = request.uri
        return self._response(request, (("Transport", rtsp.format_transport(transport)), self._session_header()))

    def playing(self, request: RtspRequest, start: tuple[int, int] | None) -> Response:
        """Return the response to PLAY.

        `start` is sequence number and timestamp of the first packet, if known.
        """
        self.state = TRANSITIONS[self.state]["PLAY"]
        info = RtpInfo(self._url, *(start or (None, None)))
        headers = (
            ("Range", rtsp.format_range(None)),
            ("RTP-Info", rtsp.format_rtp_info([info])),
            self._session_header(),
        )
        return self._response(request, headers)

    def done(self, request: RtspRequest) -> Response:
        """Return the response to PAUSE or TEARDOWN."""
        self.state = TRANSITIONS[self.state][request.method]
        return self._response(request, (self._session_header(),))

    def _session_header(self) -> tuple[str, str]:
        return "Session", rtsp.format_session(self._session, self._timeout)

    def _response(
        self,
        request: RtspRequest,
        headers: Headers,
        status: Status = Status.OK,
        body: bytes = b"",
        reason: str = "",
    ) -> Response:
        number = () if request.cseq is None else (("CSeq", str(request.cseq)),)
        return Response(status, (*number, ("Server", SERVER), *headers), body, reason)


def stream_path(uri: str) -> tuple[str, ...]:
    """Return the parts of a stream's path, without its track; empty when there is none."""
    url = rtsp.split_url(uri)
    if url is None or len(url[2]) > MAX_PATH:
        return ()
    parts = tuple(part for part in url[2].partition("?")[0].split("/") if part)
    return parts[:-1] if len(parts) > 1 and parts[-1] == CONTROL else parts


def _usable(header: str) -> tuple[RtspTransport, ...]:
    """Return the usable transports of a header: UDP to given ports, or inside the connection."""
    usable = []
    for offer in rtsp.parse_transport(header):
        if offer.lower == "UDP" and offer.unicast and offer.client_ports is not None:
            usable.append(RtspTransport(client_ports=offer.client_ports))
        elif offer.lower == "TCP":
            usable.append(RtspTransport(lower="TCP", channels=offer.channels or (0, 1)))
    return tuple(usable)
