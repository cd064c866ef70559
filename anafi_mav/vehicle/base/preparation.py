"""Preparation of the drone for a requested flight task: a machine without I/O.

Every wait between a request and the first command of its task is a step of this machine, so that `Control` checks all
conditions of the request again after each of them. What is true of one request only is in its `DescentEnd`.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, replace

from anafi_mav.vehicle.base.right import Right


class Preparation(enum.Enum):
    """How the drone is prepared for a task."""

    AS_IT_IS = "nothing is sent: the task itself replaces the motion, or stops it"
    HOVER = "hover, without waiting: what moves is cancelled, the sticks are centred"
    STOP = "stop, and wait until the drone has confirmed the end of its moves"
    END_LANDING = "a landing that the request may end is ended"
    RISE_AGAIN = "a landing that the request may end is ended, by a TakeOff too"
    END_DESCENT = "a landing or return that the request may end is ended, then the drone stops"


ENDS_LANDING = (Preparation.END_LANDING, Preparation.RISE_AGAIN, Preparation.END_DESCENT)
"""A landing is ended, or the request is refused."""


class PreparationStep(enum.Enum):
    """A step of a preparation; its value is the explanation."""

    HOVER = "cancel what moves, without waiting"
    STOP = "stop, and wait until the drone has confirmed it"
    CANCEL_RETURN = "cancel a return that a user has commanded, also one that is not reported yet"
    CANCEL_OWN_RETURN = "cancel the return that the drone flew by itself when the request arrived"
    END_LANDING = "end the landing that is reported"
    SETTLE_LANDING = "wait until it is known whether a withdrawn Landing has begun all the same"
    RISE_AGAIN = "end the landing by gaz and a TakeOff"
    ANSWER_ANNOUNCED = "cancel the return that the drone has announced, or notify the clients how that is done"


_STEPS: Mapping[Preparation, tuple[PreparationStep, ...]] = {
    Preparation.AS_IT_IS: (PreparationStep.CANCEL_RETURN,),
    Preparation.HOVER: (PreparationStep.CANCEL_RETURN, PreparationStep.HOVER),
    Preparation.STOP: (PreparationStep.STOP, PreparationStep.CANCEL_RETURN),
    Preparation.END_LANDING: (PreparationStep.SETTLE_LANDING, PreparationStep.END_LANDING),
    Preparation.RISE_AGAIN: (PreparationStep.SETTLE_LANDING, PreparationStep.RISE_AGAIN),
    Preparation.END_DESCENT: (
        PreparationStep.END_LANDING,
        PreparationStep.CANCEL_OWN_RETURN,
        PreparationStep.STOP,
        PreparationStep.CANCEL_RETURN,
        PreparationStep.SETTLE_LANDING,
        PreparationStep.END_LANDING,
        PreparationStep.ANSWER_ANNOUNCED,
    ),
}


@dataclass(frozen=True)
class DescentEnd:
    """Facts of one request that may end a landing or a return, from its arrival on."""

    right: Right | None
    """Of its client; None: a part of the gateway, which ends none that the drone or a client began."""
    is_of_own_return: bool = False
    """The drone flew home by itself then. A return that it begins afterwards goes on."""
    cancels_announced: bool | None = None
    """A return was announced then: True: it is cancelled, False: this is its client's first Hold; None otherwise."""


@dataclass(frozen=True)
class Preparing:
    """State of the preparation of one request: the steps that are left."""

    start: Preparation
    left: tuple[PreparationStep, ...]
    """The next one first; empty: the drone is ready."""

    def after(self, *, has_ended: bool) -> Preparing:
        """Return the state after the next step; `has_ended`: there was something to end."""
        done, *left = self.left
        if (
            done is PreparationStep.END_LANDING
            and has_ended
            and PreparationStep.STOP in _STEPS[self.start]
            and PreparationStep.STOP not in left
        ):
            left.insert(0, PreparationStep.STOP)  # it has begun since the first one, and left the drone in motion
        return replace(self, left=tuple(left))


def begin(start: Preparation, *, stands: bool, cancels_return: bool, plays: bool = False) -> Preparing:
    """Return the first state of a preparation.

    `stands`: the drone is on the ground, and nothing of ours is about to lift it. `cancels_return`: the task may not
    fly during a return. `plays`: the drone reports that it flies a plan, during which it takes no sticks.
    """
    if stands and start is Preparation.END_DESCENT:
        return Preparing(start, ())
    keeps_return = not cancels_return and start is not Preparation.END_DESCENT
    steps = tuple(one for one in _STEPS[start] if one is not PreparationStep.CANCEL_RETURN or not keeps_return)
    if plays and cancels_return and PreparationStep.STOP not in steps:
        steps = (PreparationStep.STOP, *steps)
    return Preparing(start, steps)
