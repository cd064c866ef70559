"""What a Skycontroller is for, with Parrot's Olympe alone: its states, the drone's through it, sticks and buttons."""

from __future__ import annotations

import json
import urllib.request

from olympe_base import LIMIT, Visit, plain  # isort: skip
from olympe.messages import drone_manager, mapper, skyctrl
from olympe.messages.ardrone3 import Piloting, PilotingEvent
from olympe.messages.common import CommonState, SettingsState


class Controller(Visit):
    def use_controller(self) -> None:
        self.begin("controller")
        self.expect("drone", drone_manager.connection_state(state="connected", _policy="check_wait", _timeout=LIMIT))
        # Both of the drone's own answers, which came through the controller.
        self.expect("states", CommonState.AllStatesChanged(_policy="check_wait", _timeout=LIMIT))
        self.expect("settings", SettingsState.AllSettingsChanged(_policy="check_wait", _timeout=LIMIT))
        self.say("both", bool(self.drone.drone_connection_state()))
        self.result["known"] = {
            name: self.state(message)
            for name, message in {
                "product": mapper.active_product,
                "source": skyctrl.CoPilotingState.pilotingSource,
                "battery": skyctrl.SkyControllerState.BatteryChanged,
                "version": skyctrl.SettingsState.ProductVersionChanged,
                "drone name": SettingsState.ProductNameChanged,
                "serial of the drone": SettingsState.ProductSerialHighChanged,
                "serial of the drone low": SettingsState.ProductSerialLowChanged,
            }.items()
        }
        if type(self.drone).__name__ == "SkyController4":
            self.look_at_devices()
        self.look_at_the_web()
        self.fly_by_controller()

    def look_at_devices(self) -> None:
        from olympe.messages import controllerNetwork, devicemanager

        network, devices = controllerNetwork, devicemanager
        self.expect("links", network.Command.GetState(_timeout=LIMIT) >> network.Event.State(_policy="check"))
        self.expect("devices", devices.Command.GetState(_timeout=LIMIT) >> devices.Event.State(_policy="check"))
        observed = json.dumps(self.drone.get_state(devices.Event.State), default=str)
        self.result["known"]["devices"] = json.loads(observed)

    def look_at_the_web(self) -> None:
        """The drone's web server, by whatever way Olympe has to it."""
        proxy = self.drone.http_proxy
        if self.say("web", proxy is not None):
            url = f"http://{proxy.address}:{proxy.port}/api/v1/info/properties"
            with urllib.request.urlopen(url, timeout=LIMIT) as answer:
                self.result["known"]["web"] = json.load(answer)

    def fly_by_controller(self) -> None:
        self.expect("take off", Piloting.TakeOff())
        self.flying_state("hovering", "hovering")
        end = PilotingEvent.moveByEnd(_policy="check", _timeout=LIMIT)
        self.expect("moveBy", Piloting.moveBy(5, 0, -1, 0, _timeout=LIMIT) >> end)
        self.result["moveBy"] = plain(dict(self.drone.get_last_event(PilotingEvent.moveByEnd).args))
        self.flying_state("there", "hovering")
        self.expect("source", skyctrl.CoPiloting.setPilotingSource(source="Controller", _timeout=LIMIT))
        with self.step("sticks") as entry:
            entry["ok"] = self.hold(0, 40, 0, 0)
        self.expect("grab", mapper.grab(buttons=0, axes=0b1111, _timeout=LIMIT))
        self.expect("ungrab", mapper.grab(buttons=0, axes=0, _timeout=LIMIT))
        self.expect("source back", skyctrl.CoPiloting.setPilotingSource(source="SkyController", _timeout=LIMIT))
        self.expect("land", Piloting.Landing())
        self.flying_state("landed", "landed")
