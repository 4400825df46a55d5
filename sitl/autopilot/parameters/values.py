"""Parameter values of one vehicle, and the autopilot settings that they imply."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from operator import attrgetter

from sitl.autopilot.parameters.parameter import Bound, Parameter, encoded
from sitl.config.autopilot import AutopilotConfig
from sitl.values.checksum import crc32


class Values:
    """Values in the order of the table; values that are not ``saved`` come from ``config`` and the table."""

    def __init__(
        self, table: Sequence[Parameter], config: AutopilotConfig, saved: Mapping[str, float]
    ) -> None:
        """Entries of ``saved`` that are unknown or not allowed are dropped."""
        self.table = tuple(table)
        self._numbers = {parameter.name: number for number, parameter in enumerate(self.table)}
        self._initial = [_initial(parameter, config) for parameter in self.table]
        self._values = list(self._initial)
        self._digest: int | None = None
        for name, value in saved.items():
            number = self._numbers.get(name)
            if number is not None and self.table[number].refusal(value) is None:
                self._values[number] = self.table[number].fitted(value)

    def __len__(self) -> int:
        return len(self.table)

    def number(self, name: str) -> int | None:
        """Return the index of a parameter in the table, or None if it does not exist."""
        return self._numbers.get(name)

    def value(self, number: int) -> float:
        """Return the present value of the parameter at ``number``."""
        return self._values[number]

    def initial(self, number: int) -> float:
        """Return the initial value of the parameter at ``number``."""
        return self._initial[number]

    def named(self, name: str) -> float:
        """Return the present value by name; raise KeyError if it does not exist."""
        return self._values[self._numbers[name]]

    def set(self, number: int, value: float) -> str | None:
        """Set the parameter at ``number``, or return the reason against ``value``."""
        parameter = self.table[number]
        if math.isfinite(value) and abs(value) <= 3e38:
            value = parameter.fitted(value)
        refusal = parameter.refusal(value)
        if refusal is None:
            self._values[number] = value
            self._digest = None
        return refusal

    def reset(self) -> None:
        """Restore all initial values."""
        self._values = list(self._initial)
        self._digest = None

    @property
    def changed(self) -> dict[str, float]:
        """Values that differ from the initial ones, for saving."""
        triples = zip(self.table, self._initial, self._values, strict=True)
        return {parameter.name: value for parameter, initial, value in triples if value != initial}

    def configured(self, config: AutopilotConfig) -> AutopilotConfig:
        """Return ``config`` with the settings of changed parameters."""
        changed = self.changed
        update: dict[str, object] = {}
        groups: dict[str, dict[str, object]] = {}
        for parameter in self.table:
            if parameter.bound is None or parameter.name not in changed:
                continue
            value = _setting(parameter.bound, changed[parameter.name])
            group, _, setting = parameter.bound.setting.rpartition(".")
            (groups.setdefault(group, {}) if group else update)[setting] = value
        for group, settings in groups.items():
            update[group] = getattr(config, group).model_copy(update=settings)
        return config.model_copy(update=update) if update else config

    def digest(self) -> int:
        """Return PX4's ``_HASH_CHECK``: CRC-32 over names and values, without inversion at either end."""
        if self._digest is None:
            self._digest = self._summed()
        return self._digest

    def _summed(self) -> int:
        crc = 0
        for parameter, value in zip(self.table, self._values, strict=True):
            data = parameter.name.encode() + encoded(value, parameter.kind, bytewise=True)
            crc = crc32(data, crc)
        return crc


def _initial(parameter: Parameter, config: AutopilotConfig) -> float:
    bound = parameter.bound
    value = None if bound is None else attrgetter(bound.setting)(config)
    if bound is None or value is None:
        return parameter.fitted(parameter.default)
    for number, word in bound.options:
        if word == value:
            return number
    # A setting without a number in this firmware reads as the firmware's default.
    return parameter.fitted(parameter.default if bound.options else value / bound.scale)


def _setting(bound: Bound, value: float) -> object:
    if bound.options:
        return dict(bound.options)[round(value)]
    return int(value) if bound.setting == "system_id" else value * bound.scale
