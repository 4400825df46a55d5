"""Settings of one autopilot: its configuration, with the changes by its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

from sitl.autopilot.parameters import ardupilot, px4
from sitl.autopilot.parameters.values import Values
from sitl.config.autopilot import AutopilotConfig

_TABLES: Final = {"ardupilot": ardupilot.table, "px4": px4.table}


class Configurable(Protocol):
    """Part of an autopilot whose settings can change."""

    def configure(self, config: AutopilotConfig, /) -> None:
        """Use new settings from now on."""
        ...


class Settings:
    """Present ``config``, and the ``values`` of the parameters that change it.

    Its parts are told of a change, in the order in which they were added.
    """

    def __init__(self, config: AutopilotConfig, rotors: int, saved: Mapping[str, float]) -> None:
        """Apply the ``saved`` values to ``config``; ``rotors``: their number, which the table depends on."""
        self.values = Values(_TABLES[config.flavour](rotors), config, saved)
        self.config = self.values.configured(config)
        self._parts: list[Configurable] = []
        self._initial = config

    def add(self, part: Configurable) -> None:
        """Tell ``part`` of changes from now on."""
        self._parts.append(part)

    def apply(self) -> None:
        """Apply the parameters that are settings.

        The system id is excepted: it takes effect at the next boot.
        """
        changed = self.values.configured(self._initial)
        self.config = changed.model_copy(update={"system_id": self.config.system_id})
        for part in self._parts:
            part.configure(self.config)
