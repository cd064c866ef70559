"""Every command that a controller can send is answered by the simulator, or stands in a table that says why not."""

from __future__ import annotations

import pytest
from support.reactions import COMMANDS, MODELS, OF_A_CONTROLLER, unanswered, unanswered_by_controller
from support.silent_commands import CONTROLLERS, DRONES, reason


@pytest.mark.parametrize("model", MODELS)
def test_commands_unanswered_by_a_drone_equal_the_list(model: str) -> None:
    silent = unanswered(model)
    assert {name for name in silent if reason(name, model, DRONES) is None} == set(), "silence without a reason"
    observed = {
        command.NAME
        for command in COMMANDS
        if not command.NAME.startswith(OF_A_CONTROLLER) and reason(command.NAME, model, DRONES) is not None
    }
    assert observed - silent == set(), "the table says that it is silent, and it is not"


@pytest.mark.parametrize("generation", [3, 4])
def test_commands_unanswered_by_a_skycontroller_equal_the_list(generation: int) -> None:
    silent = unanswered_by_controller(generation)
    assert {name for name in silent if reason(name, str(generation), CONTROLLERS) is None} == set()
    observed = {
        command.NAME
        for command in COMMANDS
        if command.NAME.startswith(OF_A_CONTROLLER) and reason(command.NAME, str(generation), CONTROLLERS) is not None
    }
    assert observed - silent == set()
