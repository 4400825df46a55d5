"""Sweep file: scenarios or scenes, values by dotted keys, the number of runs, and the cells of the grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from itertools import product
from typing import Annotated, NamedTuple

from pydantic import Field, JsonValue, model_validator

from outrider.scenarios.part import Part

MOST_CELLS = 1_000
Key = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*$")]
Axis = Annotated[
    str,
    Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*( [+] [A-Za-z_][A-Za-z0-9_.]*)*$"),
]
Values = Annotated[tuple[JsonValue, ...], Field(min_length=1, max_length=1000)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class Sweep(Part):
    """Sweep of scenarios or scenes over a grid of values.

    Every scenario (or scene) is flown with every combination of the grid's values, and each combination as it
    is and with each of the values to vary.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$", description="names the output directory")
    description: str = Field("", description="one line for lists and reports")
    scenarios: tuple[Name, ...] = Field((), description="files, or names of shipped scenarios")
    scenes: tuple[Name, ...] = Field((), description="or scenes, of which every seed draws another scenario")
    runs: int = Field(100, ge=1, le=1_000_000, description="seeds of every cell")
    first_seed: int = Field(
        1, ge=0, le=1_000_000_000, description="first seed of every cell; the others follow it"
    )
    set: dict[Key, JsonValue] = Field(
        {}, description="values for all cells by dotted key: companion.planar: true"
    )
    grid: dict[Axis, Values] = Field(
        {}, description="values to combine, by dotted key; 'a.b + c.d' gives both keys the same value"
    )
    vary: dict[Axis, Values] = Field(
        {}, description="values to try one at a time, all else as it is; by dotted key as in grid"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Sweep:
        if bool(self.scenarios) == bool(self.scenes):
            raise ValueError("needs either scenarios or scenes")
        keys = [key for axis in (*self.grid, *self.vary) for key in axis_keys(axis)]
        keys += self.set
        twice = {a for i, a in enumerate(keys) for j, b in enumerate(keys) if i != j and _within(a, b)}
        if twice:
            raise ValueError(f"{', '.join(sorted(twice))}: set in two places; allowed: one")
        count = len(self.sources)
        for values in self.grid.values():
            count *= len(values)
        count *= 1 + sum(len(values) for values in self.vary.values())
        if count > MOST_CELLS:
            raise ValueError(f"the grid has {count} cells; allowed are {MOST_CELLS}")
        return self

    @property
    def sources(self) -> tuple[str, ...]:
        """Names or files of the scenarios, or of the scenes."""
        return self.scenarios or self.scenes

    @property
    def seeds(self) -> range:
        """The seeds of every cell."""
        return range(self.first_seed, self.first_seed + self.runs)


class Point(NamedTuple):
    """One combination: ``source`` with ``changes`` by dotted key.

    ``label`` names the combination within the sweep: by its values of ``grid`` and ``vary``, each with the
    shortest end of its key that is unique, and by the source if there are several sources or no such values.
    """

    source: str
    label: str
    changes: dict[str, JsonValue]


def points(sweep: Sweep) -> Iterator[Point]:
    """Yield every combination, the last key of the grid varying fastest, each followed by its variations."""
    axes = [*sweep.grid, *sweep.vary]
    names = dict(zip(axes, _short([axis_keys(axis)[0] for axis in axes]), strict=True))
    varied = [(axis, value) for axis, values in sweep.vary.items() for value in values]
    for source in sweep.sources:
        for values in product(*sweep.grid.values()):
            combined = list(zip(sweep.grid, values, strict=True))
            for chosen in (combined, *([*combined, one] for one in varied)):
                changes = dict(sweep.set)
                words = [source] if len(sweep.sources) > 1 or not chosen else []
                for axis, value in chosen:
                    changes.update(dict.fromkeys(axis_keys(axis), value))
                    words.append(f"{names[axis]}={_word(value)}")
                yield Point(source, " ".join(words), changes)


def axis_keys(axis: str) -> list[str]:
    """Return the dotted keys that an axis of the grid sets."""
    return axis.split(" + ")


def overlay(document: Mapping[str, JsonValue], changes: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """Return ``document`` with each dotted key set.

    Missing mappings on the path are created. Whether the keys exist is checked by the model, not here.
    """
    result: dict[str, JsonValue] = deepcopy(dict(document))
    for key, value in changes.items():
        *way, last = key.split(".")
        inner = result
        for part in way:
            found = inner.get(part)
            if not isinstance(found, dict):
                found = {}
                inner[part] = found
            inner = found
        inner[last] = deepcopy(value)
    return result


def leaves(document: Mapping[str, JsonValue], prefix: str = "") -> dict[str, JsonValue]:
    """Return the values of nested mappings by dotted key; empty mappings are dropped.

    `overlay` of the result on an empty document restores the mappings that are not empty.
    """
    found: dict[str, JsonValue] = {}
    for key, value in document.items():
        if isinstance(value, dict):
            found |= leaves(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found


def _within(key: str, other: str) -> bool:
    """Return whether ``key`` equals ``other`` or lies below it."""
    return f"{key}.".startswith(f"{other}.")


def _short(keys: list[str]) -> list[str]:
    """Return the shortest end of each dotted key that is unique among the keys."""
    short = []
    for key in keys:
        parts = key.split(".")
        ends = [".".join(parts[-length:]) for length in range(1, len(parts) + 1)]
        others = [other for other in keys if other != key]
        own = (end for end in ends if not any(f".{other}".endswith(f".{end}") for other in others))
        short.append(next(own, key))
    return short


def _word(value: JsonValue) -> str:
    """Return a value as text for a label: short and on one line."""
    match value:
        case list():
            text = "+".join(_word(one) for one in value) or "none"
        case dict():
            text = "{" + ",".join(f"{key}:{_word(one)}" for key, one in value.items()) + "}"
        case None | bool():
            text = {None: "null", True: "true", False: "false"}[value]
        case _:
            text = str(value)
    return text if len(text) <= 60 else text[:59] + "…"
