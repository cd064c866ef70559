"""A simulated ANAFI on the real wire: the product behind ``anafi-mav sim``, and what the tests fly.

It speaks `arsdk` in the device's role and shares nothing else with the gateway, so that a misreading of the protocol
cannot hide in both.
"""

from anafi_mav.sim.drone import DroneSpec, SimulatedDrone
from anafi_mav.sim.fleet import Simulator
from anafi_mav.sim.log import LogEntry

__all__ = ["DroneSpec", "LogEntry", "SimulatedDrone", "Simulator"]
