"""Bars of fused detections: bearings, error against the best single camera, and NEES, over several flights.

``python -m benchmarks.perception [--sensors S] [--seeds FIRST LAST] [--seconds S] [CASE…]``. Each
case is the scenario ``perception`` with a few changes. The detections that one companion received are given
to filters again: with all cameras, and with each camera alone, so that all estimates are of one flight.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import cos, degrees, pi, radians, sin, tan
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from companion.config.target_source import FusedSource
from companion.estimation.detections import Detection
from companion.estimation.fusion import Fusion
from outrider.resources import config_root, find
from outrider.runs.ground_truth import Samples
from outrider.runs.perception import bearings_quality
from outrider.scenarios.changes import merged
from outrider.scenarios.companion_settings import settings_of
from outrider.scenarios.part import FIRST_SYSTEM
from outrider.scenarios.scenario import Scenario
from outrider.simulation.flight import Flight
from outrider.yaml_files.yaml_file import load
from sitl.vehicle.config import VehicleConfig

Array = NDArray[np.float64]
AHEAD_US, FROM_US = 100_000, 2_000_000
"""An estimate is compared so long after each image, from so long after the start on."""
SETTLED_S = 20.0
"""Bearings are judged from so long after the start on; in a shorter flight the last two seconds."""
_COARSE_PIXELS, _FINE_PIXELS, _RANGE_M = 8.0, 4.6, 0.6
"""σ (pixels) of cameras of which one has three times the w_k of the others: σ² 2.98 to 1, rays 7.8 m long."""
_FOCAL_PIXELS = 640.0 / tan(radians(35.0))


def _unequal(vehicles: int) -> Mapping[str, Any]:
    """Return the changes for a fleet whose first camera weighs three times as much as each other one.

    The formation takes the weights as measured; the configured ones are those of its figure.
    """
    coarse, fine = (degrees(pixels / _FOCAL_PIXELS) for pixels in (_COARSE_PIXELS, _FINE_PIXELS))
    better = {"vehicle": FIRST_SYSTEM, "sigma_range": _RANGE_M, "sigma_bearing_deg": fine}
    camera = {"mount": {"kind": "gimbal", "pitch_deg": 40.0}, "rate_hz": 10.0, "latency_ms": 100.0}
    formation = {"sigma_range": _RANGE_M, "sigma_bearing_deg": coarse, "cameras": [better]}
    return {
        "vehicles": vehicles,
        "camera": {"pixel_sigma": _COARSE_PIXELS},
        "cameras": [{"vehicle": FIRST_SYSTEM, "camera": {**camera, "pixel_sigma": _FINE_PIXELS}}],
        "companion": {"formation": formation},
    }


def _worse(formation: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the changes for a fleet of which two cameras have three times the σ of the others."""
    camera = {"mount": {"kind": "gimbal", "pitch_deg": 40.0}, "rate_hz": 10.0, "latency_ms": 100.0}
    worse = {**camera, "pixel_sigma": 6.0, "object": {"height_sigma": 0.45}}
    return {
        "cameras": [{"vehicle": FIRST_SYSTEM + k, "camera": worse} for k in range(2)],
        "companion": {"formation": formation},
    }


def _hidden(formation: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the changes for a target that rests, and is hidden by posts from two of five equal bearings."""
    east, north = 12.0, 0.0
    posts = [
        {
            "kind": "post",
            "at": [east + 2.0 * cos(bearing), north + 2.0 * sin(bearing)],
            "radius": 0.3,
            "height": 5.0,
        }
        for bearing in (0.0, 0.4 * pi)
    ]
    return {
        "target": {"kind": "fixed", "at": [east, north, 0.0]},
        "obstacles": posts,
        "companion": {"formation": formation},
    }


_LOSS: Mapping[str, Any] = {"links": {"swarm": {"loss": 0.2}}}
_SPREAD: Mapping[str, Any] = {"kind": "spread"}
CASES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "2": {"vehicles": 2},
        "3": {"vehicles": 3},
        "5": {},
        "8": {"vehicles": 8},
        "3, loss 20 %": {"vehicles": 3, **_LOSS},
        "5, loss 20 %": _LOSS,
        "8, loss 20 %": {"vehicles": 8, **_LOSS},
        "disturbed": {"camera": {"false_positives": 0.05, "missed": 0.2, "latency_ms": 200.0}},
        "3, unequal": _unequal(3),
        "5, unequal": _unequal(5),
        "certified": {"companion": {"avoidance": "certified"}},
        "worse": _worse({}),
        "worse, spread": _worse(_SPREAD),
        "hidden": _hidden({}),
        "hidden, spread": _hidden(_SPREAD),
    }
)


class Figures(NamedTuple):
    """Figures of one flight.

    ``fused``, ``single`` (m): RMSE of all cameras together and of the best one; ``nees`` of three and its
    degrees of freedom ``freedom``, ``level`` and ``height`` NEES of the horizontal plane (two) and of the
    height (one); ``jump`` (m): largest change of the error from one image to the next;
    ``bearings``: |s|/Σw in the two seconds from 20 s after the start on, ``further``: from then to the end;
    ``angle`` (deg): between the first two vehicles, in these two seconds; ``separation`` (m): least distance
    of two vehicles at any time.
    """

    fused: float
    single: float
    nees: float
    freedom: float
    level: float
    height: float
    jump: float
    bearings: float
    further: float
    angle: float
    separation: float


class Heard(NamedTuple):
    """Detections that one companion received, in the order of their images, and its settings."""

    source: FusedSource
    detections: Sequence[Detection]


@contextmanager
def recorded() -> Iterator[dict[int, list[Detection]]]:
    """Record the detections given to each filter, by the filter."""
    found: dict[int, list[Detection]] = {}
    original = Fusion.put

    def put(self: Fusion, detection: Detection) -> bool:
        found.setdefault(id(self), []).append(detection)
        return original(self, detection)

    cast(Any, Fusion).put = put
    try:
        yield found
    finally:
        cast(Any, Fusion).put = original


def fly(case: str, sensors: str, seed: int, seconds: float) -> tuple[Scenario, Samples, Heard]:
    """Fly a case; return the scenario, the truth, and what the companion that received most received."""
    changes = {**CASES[case], "sensors": sensors, "cap_s": seconds}
    scenario = Scenario.model_validate(
        merged(load(find("scenarios", "perception"), Scenario).model_dump(), changes)
    )
    vehicle = load(find("vehicles", "firefly"), VehicleConfig)
    with recorded() as found:
        flight = Flight(scenario, vehicle, seed, config_root() / "logs")
        flight.run()
    most = max(found.values(), key=len)
    source = settings_of(scenario).target_source
    if not isinstance(source, FusedSource):
        raise TypeError(f"case {case}: target_source.kind = {source.kind}; only fused is allowed")
    return (
        scenario,
        flight.truth.samples(),
        Heard(source, sorted(most, key=lambda one: (one.time, one.vehicle))),
    )


def errors(heard: Heard, samples: Samples, vehicle: int | None = None) -> tuple[Array, Array]:
    """Return errors (n, 3), m, and covariances (n, 3, 3) of the filter, or of one with a single camera.

    Without a row if that camera sees nothing.
    """
    fusion = Fusion(heard.source, FROM_US)
    times, places, covariances = [], [], []
    for one in heard.detections:
        if vehicle is not None and one.vehicle != vehicle:
            continue
        fusion.put(one)
        time = one.time + AHEAD_US
        known = fusion.at(time, FROM_US)
        if known is not None and samples.time[0] + FROM_US <= time <= samples.time[-1]:
            times.append(time)
            places.append(known.position)
            covariances.append(known.covariance)
    true = np.column_stack([np.interp(times, samples.time, axis) for axis in samples.target.T])
    return np.array(places).reshape(-1, 3) - true, np.array(covariances).reshape(-1, 3, 3)


def nees(off: Array, covariances: Array) -> tuple[float, float]:
    """Return the mean of the squared normalised errors ``off`` (n, m), and its degrees of freedom.

    ``covariances`` (n, m, m); the mean is m if they are right.
    Successive errors are not independent: the squares of n rows are about n/τ independent numbers.
    """
    normalised = np.linalg.solve(np.linalg.cholesky(covariances), off[..., None])[..., 0]
    inverse = sum(_correlation_time(axis) / len(axis) for axis in normalised.T)
    return float((normalised**2).sum(axis=1).mean()), off.shape[1] ** 2 / inverse


def _correlation_time(values: Array) -> float:
    """Return τ = 1 + 2 Σ r_k² (rows) of the squares of ``values`` (n,), up to the first zero of r.

    r is the autocorrelation about zero, the expected value: about the mean of the flight, a bias that lasts
    longer than it, as with ``gnss``, would count as many independent numbers. Squares of normal numbers with
    the correlation r have the correlation r².
    """
    power = np.abs(np.fft.rfft(values, 2 * len(values))) ** 2
    correlation = np.fft.irfft(power)[: len(values)]
    correlation /= correlation[0]
    first = int(np.argmax(correlation < 0.0)) or len(values)
    return float(1.0 + 2.0 * (correlation[1:first] ** 2).sum())


def figures(case: str, sensors: str, seed: int, seconds: float) -> Figures:
    """Fly a case and return its figures."""
    scenario, samples, heard = fly(case, sensors, seed, seconds)
    off, covariances = errors(heard, samples)
    alone = [errors(heard, samples, system)[0] for system in scenario.systems[: scenario.vehicles]]
    mean, freedom = nees(off, covariances)
    since = samples.time - samples.time[-1] + 1e6 * max(seconds - SETTLED_S, 1e-6 * FROM_US)
    further, late = since >= 0.0, (since >= 0.0) & (since <= FROM_US)
    quality, _ = bearings_quality(scenario, samples)
    end = samples.position[late][:, :2] - samples.target[late][:, None]
    angles = np.degrees(np.arctan2(end[..., 1], end[..., 0]))
    apart = (angles[:, 1] - angles[:, 0] + 180.0) % 360.0 - 180.0
    return Figures(
        _rms(off),
        min(_rms(one) for one in alone if len(one)),
        mean,
        freedom,
        nees(off[:, :2], covariances[:, :2, :2])[0],
        nees(off[:, 2:], covariances[:, 2:, 2:])[0],
        float(np.linalg.norm(np.diff(off, axis=0), axis=1).max()),
        float(quality[late].mean()),
        float(quality[further].mean()),
        float(np.abs(apart).mean()),
        float(samples.separation.min()),
    )


def _rms(off: Array) -> float:
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def main() -> None:
    """Write a line for each flight, and two for all flights of a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=["5"], choices=CASES)
    parser.add_argument("--sensors", default="rtk", choices=["truth", "rtk", "gnss"])
    parser.add_argument("--seeds", nargs=2, type=int, default=[1, 10], metavar=("FIRST", "LAST"))
    parser.add_argument("--seconds", type=float, default=22.0, help="length of a flight")
    options = parser.parse_args()
    for case in options.cases:
        rows = []
        for seed in range(options.seeds[0], options.seeds[1] + 1):
            rows.append(figures(case, options.sensors, seed, options.seconds))
            _say(f"{case} {options.sensors} {seed}: {_said(rows[-1])}")
        together, low, high = summed(rows)
        _say(f"{case} {options.sensors} all: {_said(together)}")
        _say(f"{case} {options.sensors} all: band of NEES {low:.2f} to {high:.2f}")


def summed(rows: Sequence[Figures]) -> tuple[Figures, float, float]:
    """Return the figures of all flights, and the 95 % band of their mean NEES.

    RMSEs are over all flights, degrees of freedom their sum, the others means.
    """
    table = np.array(rows)
    fused, single = np.sqrt((table[:, :2] ** 2).mean(axis=0)).tolist()
    freedom = float(table[:, 3].sum())
    # Quantiles of χ²(ν)/ν by Wilson and Hilferty.
    share = 2.0 / (9.0 * freedom)
    low, high = (3.0 * (1.0 - share + z * np.sqrt(share)) ** 3 for z in (-1.96, 1.96))
    means = Figures(*table.mean(axis=0).tolist())
    return means._replace(fused=fused, single=single, freedom=freedom), float(low), float(high)


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _said(row: Figures) -> str:
    return (
        f"fused {row.fused:.4f} m, single {row.single:.4f} m, ratio {row.fused / row.single:.3f},"
        f" NEES {row.nees:.2f} (ν {row.freedom:.0f}, plane {row.level:.2f}, height {row.height:.2f}),"
        f" jump {row.jump:.3f} m, |s|/Σw {row.bearings:.3f}, further {row.further:.3f},"
        f" angle {row.angle:.1f}°, separation {row.separation:.2f} m"
    )


if __name__ == "__main__":
    main()
