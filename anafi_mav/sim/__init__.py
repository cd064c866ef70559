"""Simulated ANAFI that speaks ARSDK: used by ``anafi-mav sim`` and by the tests.

It speaks `arsdk` in the device's role and shares nothing else with the gateway, so that a misreading of the protocol
cannot hide in both.
"""

from anafi_mav.sim.drone import DroneSpec, SimulatedDrone
from anafi_mav.sim.fleet import Simulator
from anafi_mav.sim.log import LogEntry

__all__ = ["DroneSpec", "LogEntry", "SimulatedDrone", "Simulator"]
