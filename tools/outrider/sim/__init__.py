"""Physics of multirotors for Python programs: takes commands as arrays, gives the true motion.

``Vehicle`` is one vehicle, ``Batch`` many of one type, ``EscortVectorEnv`` a Gymnasium vector environment
(extra ``gym``). All is east-north-up with bodies forward-left-up, in SI units; the compiled physics below
(``sitl.vehicle``) is north-east-down.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from outrider.sim.batch import Batch
from outrider.sim.vehicle import Vehicle, VehicleState
from outrider.terminal.compilation import log_if_compiling
from sitl.vehicle.config import VehicleConfig

if TYPE_CHECKING:
    from outrider.sim.environment import EscortVectorEnv

__all__ = ["Batch", "EscortVectorEnv", "Vehicle", "VehicleConfig", "VehicleState"]

# The physics of a type of vehicle is compiled at its first step.
log_if_compiling()


def __getattr__(name: str) -> Any:
    """Import Gymnasium only when its environment is asked for."""
    if name == "EscortVectorEnv":
        from outrider.sim.environment import EscortVectorEnv

        return EscortVectorEnv
    raise AttributeError(f"module 'outrider.sim' has no attribute {name!r}")
