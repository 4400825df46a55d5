"""Random disturbances of a drawn scenario: sensors, links, wind, clocks, companion faults, partitions, jumps.

Numbers and times are drawn uniformly within their bounds. Loss, delay and jitter are drawn as least + (most −
least)·x³ with uniform x, because where nearly everything is lost no vehicle moves, and little is tested.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, JsonValue, model_validator

from companion.config.certified import CertifiedConfig
from outrider.scenarios.part import FIRST_SYSTEM, Part, Share
from sitl.estimation.profiles import PROFILES

Milliseconds = Annotated[float, Field(ge=0.0, le=5_000.0)]
Seconds = Annotated[float, Field(gt=0.0, le=120.0)]
_KNOT_US = CertifiedConfig().dt_us
_LONGEST_US: int = CertifiedConfig.model_json_schema()["properties"]["epoch_us"]["maximum"]
_FOR_GOOD_S = 600.0
"""Longer than any flight."""
Few = Annotated[int, Field(ge=0, le=20)]


class Trouble(Part):
    """Bounds (least and most) of the disturbances of swarm links, wind, clocks and companions."""

    sensors: tuple[Literal["truth", "rtk", "gnss", "sih"], ...] = Field(
        ("rtk",), min_length=1, description="one of"
    )
    loss: tuple[Share, Share] = Field(
        (0.0, 0.0), description="share of the messages of the swarm link that are lost"
    )
    delay_ms: tuple[Milliseconds, Milliseconds] = Field((20.0, 20.0), description="ms, of every message")
    jitter_ms: tuple[Milliseconds, Milliseconds] = Field(
        (0.0, 0.0), description="ms, largest additional delay of a message"
    )
    duplication: tuple[Share, Share] = Field(
        (0.0, 0.0), description="share of the messages that arrive twice"
    )
    reordering: tuple[Share, Share] = Field(
        (0.0, 0.0), description="share of the messages that later ones overtake"
    )
    wind: Annotated[float, Field(ge=0.0, le=20.0)] = Field(
        0.0, description="largest speed, m/s; any direction"
    )
    clock_ms: Milliseconds = Field(1.0, description="largest offset of a clock")
    fitting_epochs: Share = Field(
        0.75, description="probability that certified.epoch_us is set to at least delay + jitter"
    )
    partitions: tuple[Few, Few] = Field((0, 0), description="how often the swarm is divided in two")
    freezes: tuple[Few, Few] = Field((0, 0), description="how many companions hang for a while")
    vanishes: tuple[Few, Few] = Field((0, 0), description="how many companions vanish for good")
    silent: bool = Field(
        False,
        description="whether the radio of a vehicle fails for good when its companion vanishes: then nobody"
        " receives the farewell of its backup node",
    )
    gusts: tuple[Few, Few] = Field((0, 0), description="how many gusts, of for_s")
    gust: Annotated[float, Field(ge=0.0, le=30.0)] = Field(
        0.0, description="largest speed of a gust, m/s; any horizontal direction"
    )
    jumps: tuple[Few, Few] = Field((0, 0), description="how many position fixes are off, each for for_s")
    jump: Annotated[float, Field(ge=0.0, le=100.0)] = Field(
        0.0, description="largest offset of a position fix, in σ of the sensors; any horizontal direction"
    )
    restarts: tuple[Few, Few] = Field(
        (0, 0), description="how many companions end, each for for_s until another one begins in its place"
    )
    within_s: Seconds = Field(
        8.0, description="latest start of a fault after the goal event; longest pause before a partition"
    )
    for_s: tuple[Seconds, Seconds] = Field((0.5, 4.0), description="s, duration of each partition and fault")

    @model_validator(mode="after")
    def _order(self) -> Self:
        for name in Trouble.model_fields:
            span = getattr(self, name)
            if name != "sensors" and isinstance(span, tuple) and span[1] < span[0]:
                raise ValueError(f"{name}: the second must not be less than the first")
        return self


def strike(trouble: Trouble, count: int, random: np.random.Generator) -> dict[str, JsonValue]:
    """Return the disturbances of a fleet of ``count`` vehicles, as part of a scenario file."""

    def drawn(span: tuple[float, float]) -> float:
        return round(float(random.uniform(*span)), 4)

    def bad(span: tuple[float, float]) -> float:
        return round(float(span[0] + (span[1] - span[0]) * random.uniform() ** 3), 4)

    def many(span: tuple[int, int], most: int) -> int:
        return min(int(random.integers(span[0], span[1] + 1)), most)

    document: dict[str, JsonValue] = {"sensors": str(random.choice(trouble.sensors))}
    loss, delay_ms, jitter_ms = (bad(span) for span in (trouble.loss, trouble.delay_ms, trouble.jitter_ms))
    if trouble.fitting_epochs > random.uniform():
        # The epoch is then at least the largest delay of a plan that is neither lost nor reordered.
        epochs = max(int(np.ceil((delay_ms + jitter_ms) / (1e-3 * _KNOT_US))), 1)
        epoch_us = _KNOT_US * min(epochs, _LONGEST_US // _KNOT_US)
        document["companion"] = {"certified": {"epoch_us": epoch_us}}
    document["links"] = {
        "swarm": {
            "loss": loss,
            "delay_ms": delay_ms,
            "jitter_ms": jitter_ms,
            "duplication": drawn(trouble.duplication),
            "reordering": drawn(trouble.reordering),
        }
    }
    speed, course = drawn((0.0, trouble.wind)), float(random.uniform(-np.pi, np.pi))
    document["weather"] = {
        "wind": [round(float(speed * np.cos(course)), 4), round(float(speed * np.sin(course)), 4), 0.0]
    }
    document["clocks"] = {"offset_ms": trouble.clock_ms}
    order = [FIRST_SYSTEM + int(k) for k in random.permutation(count)]
    freezes, vanishes = many(trouble.freezes, count // 2), many(trouble.vanishes, count // 2)
    faults: list[JsonValue] = []
    for system in order[:freezes]:
        at_s, for_s = drawn((0.1, trouble.within_s)), drawn(trouble.for_s)
        faults.append({"kind": "freeze", "vehicle": system, "at_s": at_s, "for_s": for_s})
    faults += [
        {"kind": "vanish", "vehicle": system, "at_s": drawn((0.1, trouble.within_s))}
        for system in order[freezes : freezes + vanishes]
    ]
    document["faults"] = faults
    partitions: list[JsonValue] = []
    begins = 0.1
    for _ in range(many(trouble.partitions, 20)):
        begins, lasts = begins + drawn((0.0, trouble.within_s)), drawn(trouble.for_s)
        members = sorted(order[: int(random.integers(1, count))])
        partitions.append({"at_s": round(begins, 4), "for_s": lasts, "members": [*members]})
        begins += lasts
    document["partitions"] = partitions
    _strike_estimates(trouble, document, order, random)
    if trouble.restarts[1]:
        # Drawn last, as those.
        left = order[freezes + vanishes :]
        for system in left[: many(trouble.restarts, len(left))]:
            at_s, for_s = drawn((0.1, trouble.within_s)), drawn(trouble.for_s)
            faults.append({"kind": "restart", "vehicle": system, "at_s": at_s, "for_s": for_s})
    if trouble.silent:
        _silence(document)
    return document


def _silence(document: dict[str, Any]) -> None:
    """Cut those whose companions vanish in ``document`` off from all others, from then on."""
    for fault in document["faults"]:
        if fault["kind"] == "vanish":
            alone = [fault["vehicle"]]
            # Two partitions of the same members must not overlap.
            document["partitions"] = [cut for cut in document["partitions"] if cut["members"] != alone]
            cut = {"at_s": fault["at_s"], "for_s": _FOR_GOOD_S, "members": alone}
            document["partitions"].append(cut)


def _strike_estimates(
    trouble: Trouble, document: dict[str, Any], order: list[int], random: np.random.Generator
) -> None:
    """Add gusts to ``document``, and jumps of position fixes of vehicles in ``order``.

    They are drawn last, so that without them the same seed gives the same scenario as before.
    """

    def beside(most: float) -> list[float]:
        size, course = float(random.uniform(0.0, most)), float(random.uniform(-np.pi, np.pi))
        return [round(size * float(np.cos(course)), 4), round(size * float(np.sin(course)), 4), 0.0]

    def times() -> tuple[float, float]:
        spans = (0.1, trouble.within_s), trouble.for_s
        begins, lasts = (round(float(random.uniform(*span)), 4) for span in spans)
        return begins, lasts

    if trouble.gusts[1]:
        gusts = []
        for _ in range(int(random.integers(trouble.gusts[0], trouble.gusts[1] + 1))):
            at_s, length_s = times()
            gusts.append({"at_s": at_s, "length_s": length_s, "velocity": beside(trouble.gust)})
        document["weather"]["gusts"] = gusts
    if trouble.jumps[1]:
        most = trouble.jump * PROFILES[document["sensors"]].worst_axis
        number = int(random.integers(trouble.jumps[0], trouble.jumps[1] + 1))
        for system in order[::-1][:number]:
            at_s, for_s = times()
            jump = {"kind": "gps_jump", "vehicle": system, "at_s": at_s, "for_s": for_s}
            document["faults"].append({**jump, "offset": beside(most)})
