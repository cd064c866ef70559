"""A flight through a Skycontroller with Parrot's Olympe alone: ``olympe_skycontroller.py ADDRESS CLASS``.

CLASS is Olympe's: SkyController3 or SkyController4. Knows nothing of this project. Prints one JSON object: what each
step came to and what Olympe believes of controller and drone. Olympe's log goes to stderr.
"""

from __future__ import annotations

import json
import os
import sys
import urllib.request

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # Olympe logs to stdout

import olympe  # noqa: E402
from olympe.features.media import indexing_state  # noqa: E402
from olympe.messages import drone_manager, mapper, skyctrl  # noqa: E402
from olympe.messages.ardrone3 import Piloting, PilotingEvent, PilotingState  # noqa: E402
from olympe.messages.common import CommonState, SettingsState  # noqa: E402


def main() -> None:
    address, kind = sys.argv[1:]
    steps: dict[str, object] = {}
    known: dict[str, object] = {}
    controller = getattr(olympe, kind)(address)

    def expect(name: str, expectation: object) -> None:
        waited = controller(expectation).wait()
        steps[name] = True if waited.success() else str(waited.explain())

    def state(message: object) -> dict[str, object]:
        return {key: str(getattr(value, "name", value)) for key, value in controller.get_state(message).items()}

    steps["connect"] = bool(controller.connect())
    expect("drone", drone_manager.connection_state(state="connected", _policy="check_wait", _timeout=10))
    # Both of the drone's own answers, which came through the controller.
    expect("states", CommonState.AllStatesChanged(_policy="check_wait", _timeout=10))
    expect("settings", SettingsState.AllSettingsChanged(_policy="check_wait", _timeout=10))
    steps["both"] = bool(controller.drone_connection_state())
    for name, message in {
        "product": mapper.active_product,
        "source": skyctrl.CoPilotingState.pilotingSource,
        "battery": skyctrl.SkyControllerState.BatteryChanged,
        "serial": skyctrl.SettingsState.ProductSerialChanged,
        "version": skyctrl.SettingsState.ProductVersionChanged,
        "drone name": SettingsState.ProductNameChanged,
        "serial of the drone": SettingsState.ProductSerialHighChanged,
        "serial of the drone low": SettingsState.ProductSerialLowChanged,
        "drone battery": CommonState.BatteryStateChanged,
    }.items():
        try:
            known[name] = state(message)
        except Exception as error:
            known[name] = repr(error)

    if kind == "SkyController4":
        from olympe.messages import controllerNetwork, devicemanager

        expect(
            "links", controllerNetwork.Command.GetState(_timeout=3) >> controllerNetwork.Event.State(_policy="check")
        )
        told = controller(
            devicemanager.Command.GetState(_timeout=3) >> devicemanager.Event.State(_policy="check")
        ).wait()
        steps["devices"] = bool(told.success())
        known["devices"] = json.loads(json.dumps(controller.get_state(devicemanager.Event.State), default=str))

    # The drone's web server, by whatever way Olympe has to it.
    controller.media(indexing_state(state="indexed")).wait(_timeout=8.0)
    proxy = controller.http_proxy
    if proxy is not None:
        with urllib.request.urlopen(f"http://{proxy.address}:{proxy.port}/api/v1/info/properties", timeout=5) as answer:
            known["web"] = json.load(answer)
    steps["web"] = proxy is not None

    hovering = PilotingState.FlyingStateChanged(state="hovering", _policy="wait", _timeout=15)
    expect("take off", Piloting.TakeOff() >> hovering)
    expect("moveBy", Piloting.moveBy(5, 0, -1, 0, _timeout=30) >> PilotingEvent.moveByEnd(_policy="check", _timeout=1))
    expect("source", skyctrl.CoPiloting.setPilotingSource(source="Controller", _timeout=3))
    controller.piloting(0, 40, 0, 0, 1.0)
    flying = PilotingState.FlyingStateChanged(state="flying", _policy="check_wait", _timeout=5)
    expect("sticks", flying)
    expect("at rest", PilotingState.FlyingStateChanged(state="hovering", _policy="check_wait", _timeout=15))
    expect("grab", mapper.grab(buttons=0, axes=0b1111, _timeout=3))
    expect("ungrab", mapper.grab(buttons=0, axes=0, _timeout=3))
    expect("source back", skyctrl.CoPiloting.setPilotingSource(source="SkyController", _timeout=3))
    landed = PilotingState.FlyingStateChanged(state="landed", _policy="wait", _timeout=20)
    expect("land", Piloting.Landing() >> landed)
    steps["disconnect"] = bool(controller.disconnect())
    json.dump({"steps": steps, "known": known}, OUT)
    OUT.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
