"""Feature 150, mediastore: the index of photos and videos."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, I32, Message, OpenEnum, event


class MediastoreState(OpenEnum):
    NOT_AVAILABLE = 0
    INDEXING = 1
    INDEXED = 2


@event("mediastore.state", 150, 0, 1)
class State(Message, frozen=True):
    state: Annotated[MediastoreState, ENUM]


@event("mediastore.counters", 150, 0, 2)
class Counters(Message, frozen=True):
    video_media_count: Annotated[int, I32]
    photo_media_count: Annotated[int, I32]
    video_resource_count: Annotated[int, I32]
    photo_resource_count: Annotated[int, I32]
