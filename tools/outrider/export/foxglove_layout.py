"""Layout of Foxglove for an exported run: the 3-D scene, and plots of separation, tracking error and ∇J."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from outrider.palette import LIMIT, hex_of
from outrider.scenarios.scenario import Scenario

SUFFIX: Final = ".foxglove.json"
_SCENE, _SEPARATION, _TRACKING, _GRADIENT = "3D!scene", "Plot!separation", "Plot!tracking", "Plot!gradient"
_TOPICS: Final = ("vehicles", "trails", "plans", "planes", "target", "obstacles", "moving")


def layout_path(mcap: Path) -> Path:
    """Return the path of the layout beside the file ``mcap``."""
    return mcap.with_name(f"{mcap.stem}{SUFFIX}")


def layout(scenario: Scenario, centre: Sequence[float], reach: float) -> str:
    """Return the layout as JSON. The camera looks at ``centre`` (m, fleet-local ENU), ``reach`` (m) away."""
    systems = list(scenario.systems)
    colors = [hex_of(k, scenario.vehicles) for k in range(len(systems))]
    found = {
        "configById": {
            _SCENE: _scene(centre, reach),
            _SEPARATION: _plot(
                "Least separation, m",
                [("/separation.separation", "separation", hex_of(0)), ("/separation.d_min", "d_min", LIMIT)],
            ),
            _TRACKING: _plot("Off the reference, m", _of_each(systems, colors, "motion.off_reference")),
            _GRADIENT: _plot("‖∇J‖ / Ω_t, m", _of_each(systems, colors, "plan.gradient_norm")),
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": _SCENE,
            "second": {
                "direction": "column",
                "first": _SEPARATION,
                "second": {"direction": "column", "first": _TRACKING, "second": _GRADIENT},
                "splitPercentage": 34,
            },
            "splitPercentage": 65,
        },
    }
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


def _of_each(systems: Sequence[int], colors: Sequence[str], field: str) -> list[tuple[str, str, str]]:
    return [(f"/vehicle/{s}/{field}", str(s), color) for s, color in zip(systems, colors, strict=True)]


def _scene(centre: Sequence[float], reach: float) -> dict[str, Any]:
    return {
        "cameraState": {
            "perspective": True,
            "distance": reach,
            "phi": 60,
            "thetaOffset": 45,
            "targetOffset": [round(float(part), 2) for part in centre],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.1,
            "far": 5000,
        },
        "followMode": "follow-none",
        "followTf": "fleet",
        "scene": {"transforms": {"showLabel": False, "axisScale": 0}},
        "transforms": {},
        "topics": {f"/scene/{name}": {"visible": True} for name in _TOPICS}
        | {"/scene/paths": {"visible": False}},
        "layers": {
            "ground": {
                "layerId": "foxglove.Grid",
                "instanceId": "ground",
                "visible": True,
                "frameId": "fleet",
                "label": "Ground, 1 m",
                "size": 100,
                "divisions": 100,
                "lineWidth": 1,
                "color": "#84898e80",
                "position": [0, 0, 0],
                "rotation": [0, 0, 0],
                "order": 1,
            }
        },
        "publish": {},
        "imageMode": {},
    }


def _plot(title: str, lines: Sequence[tuple[str, str, str]]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {
                "value": value,
                "label": label,
                "color": color,
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for value, label, color in lines
        ],
        "showLegend": True,
        "legendDisplay": "top",
        "isSynced": True,
        "xAxisVal": "timestamp",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }
