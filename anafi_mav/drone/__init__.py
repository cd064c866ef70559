"""The vehicle as its owner sees it: a `Drone` with elements, each a frozen state and some verbs."""

from anafi_mav.drone.drone import Drone as Drone
from anafi_mav.drone.element import Position as Position
from anafi_mav.drone.element import Range as Range
from anafi_mav.drone.moves import Displacement as Displacement
from anafi_mav.drone.moves import Move as Move
from anafi_mav.drone.moves import MoveEnd as MoveEnd
from anafi_mav.drone.product import MODELS as MODELS
from anafi_mav.drone.product import Identity as Identity
from anafi_mav.drone.product import Model as Model
from anafi_mav.drone.sticks import Limits as Limits
from anafi_mav.drone.sticks import PilotingCommand as PilotingCommand
