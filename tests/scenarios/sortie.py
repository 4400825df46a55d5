"""The shipped sortie with as many vehicles, and of such a kind, as a test asks for."""

from __future__ import annotations

from outrider.resources import find
from outrider.scenarios.options import Options, apply
from outrider.scenarios.scenario import Scenario
from outrider.yaml_files.yaml_file import load

SORTIE = load(find("scenarios", "sortie"), Scenario)


def row(count: int) -> Scenario:
    places = [[0.0, 5.0 * k, 5.0] for k in range(count)]
    starts = {"kind": "points", "at": places}
    return Scenario.model_validate({**SORTIE.model_dump(), "vehicles": count, "starts": starts})


def of(count: int, **options: object) -> Scenario:
    return apply(row(count), Options(**options))
