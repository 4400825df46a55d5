"""MCAP: read back by the mcap library, checked against its own schemas, and against what was flown."""

from __future__ import annotations

import json
import math
from base64 import b64decode
from collections import Counter, defaultdict
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Channel, Message, Schema

from outrider.errors import InputError
from outrider.export.attitude import along_down, quaternions
from outrider.palette import VEHICLES, rgb
from outrider.resources import find
from outrider.yaml_files.yaml_file import load
from sitl.values.attitudes import quaternion
from sitl.vehicle.config import VehicleConfig
from tests.outrider.export.runs import SYSTEMS, everything, received

One = tuple[Schema, Channel, Message]
SCENES = {"vehicles", "paths", "target", "obstacles", "moving", "trails", "plans"}


class Content(NamedTuple):
    """Messages as they lie in the file, and their values by topic."""

    messages: list[One]
    values: dict[str, list[tuple[int, dict[str, Any]]]]


def content(data: bytes) -> Content:
    messages: list[One] = []
    values = defaultdict(list)
    for schema, channel, message in NonSeekingReader(BytesIO(data), validate_crcs=True).iter_messages(
        log_time_order=False
    ):
        assert schema is not None, channel.topic
        messages.append((schema, channel, message))
        values[channel.topic].append((message.log_time, json.loads(message.data)))
    return Content(messages, dict(values))


@pytest.fixture(scope="module")
def data(run: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return exported(run, tmp_path_factory.mktemp("out") / "flight.mcap")


@pytest.fixture(scope="module")
def found(data: bytes) -> Content:
    return content(data)


@pytest.fixture(scope="module")
def flight(run: Path) -> dict[str, np.ndarray]:
    with np.load(run / "flight.npz") as file:
        return dict(file)


def exported(source: Path, out: Path) -> bytes:
    from outrider.export.command import export as exporting

    exporting(source, "mcap", out, as_json=True)
    return out.read_bytes()


# The file


def test_every_channel_has_a_schema_and_every_message_fits_it(found: Content) -> None:
    checks: dict[int, Draft202012Validator] = {}
    for schema, channel, message in found.messages:
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        if schema.id not in checks:
            document = json.loads(schema.data)
            Draft202012Validator.check_schema(document)
            checks[schema.id] = Draft202012Validator(document)
        # JSON has no NaN; Python would read one.
        value = json.loads(message.data, parse_constant=pytest.fail)
        checks[schema.id].validate(value)
        assert value.keys() <= checks[schema.id].schema["properties"].keys()


def test_schemas_hold_nothing_that_foxglove_cannot_read(found: Content) -> None:
    def check(node: dict[str, Any]) -> None:
        if "oneOf" in node:
            assert all(isinstance(one["const"], int) for one in node["oneOf"])
            return
        assert node["type"] in ("object", "array", "string", "number", "integer", "boolean")
        if node["type"] == "object":
            for inner in node["properties"].values():
                check(inner)
        if node["type"] == "array":
            assert node["items"]["type"] != "array"
            check(node["items"])

    for schema in {schema.id: schema for schema, _, _ in found.messages}.values():
        check(json.loads(schema.data))


def test_it_ends_cleanly_with_an_index_and_checksums(data: bytes, found: Content, run: Path) -> None:
    reader = make_reader(BytesIO(data), validate_crcs=True)
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = Counter(channel.id for _, channel, _ in found.messages)
    assert summary.statistics.channel_message_counts == counts
    assert {channel.schema_id for channel in summary.channels.values()} == summary.schemas.keys()
    assert 0 not in summary.schemas
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    # By the index, in the order of time, it is the same.
    assert sum(1 for _ in reader.iter_messages()) == len(found.messages)
    attached = {one.name: one.data for one in reader.iter_attachments()}
    assert attached["configuration.yaml"] == (run / "configuration.yaml").read_bytes()


def test_times_go_forward(found: Content) -> None:
    times = [message.log_time for _, _, message in found.messages]
    assert times == sorted(times)


def test_the_same_run_gives_the_same_bytes(run: Path, data: bytes, tmp_path: Path) -> None:
    assert exported(run, tmp_path / "again.mcap") == data


# What was flown


def test_motions_are_those_that_were_flown(found: Content, flight: dict[str, np.ndarray]) -> None:
    start, seconds = int(flight["start_us"]), flight["time_s"]
    for k, system in enumerate(SYSTEMS):
        rows = found.values[f"/vehicle/{system}/motion"]
        assert [time for time, _ in rows] == [
            1000 * (start + round(1e6 * second)) for second in seconds.tolist()
        ]
        for name in ("position", "velocity", "reference"):
            told = np.array([vector(value.get(name)) for _, value in rows], dtype=np.float32)
            np.testing.assert_array_equal(told, flight[name][:, k])
        for name in ("yaw", "tilt"):
            told = np.array([value[name] for _, value in rows], dtype=np.float32)
            np.testing.assert_array_equal(told, flight[name][:, k])
    apart = np.array([value["separation"] for _, value in found.values["/separation"]], dtype=np.float32)
    np.testing.assert_array_equal(apart, flight["separation"])
    for k, topic in enumerate(("/moving/190", "/moving/191")):
        told = np.array([vector(value["position"]) for _, value in found.values[topic]], dtype=np.float32)
        np.testing.assert_array_equal(told, flight["moving"][:, k])


def vector(value: dict[str, float] | None) -> list[float]:
    return [math.nan] * 3 if value is None else [value[axis] for axis in ("east", "north", "up")]


def test_plans_are_those_that_were_made(found: Content, run: Path) -> None:
    for file, topic, name in (("plans", "plan", "gradient"), ("plan_times", "plan_time", "plan_ms")):
        with np.load(run / f"{file}.npz") as arrays:
            for system in SYSTEMS:
                rows = found.values[f"/vehicle/{system}/{topic}"]
                expected = arrays[name][arrays["system"] == system]
                assert len(rows) == len(expected) > 100
                told = [vector(value[name]) if name == "gradient" else value[name] for _, value in rows]
                np.testing.assert_allclose(told, expected, rtol=1e-15)


def test_frames_lie_as_the_vehicles_did(found: Content, flight: dict[str, np.ndarray]) -> None:
    rows = found.values["/tf"]
    assert len(rows) == len(flight["time_s"])
    for k, system in enumerate(SYSTEMS):
        told = [one for _, value in rows for one in value["transforms"]]
        told = [one for one in told if one["child_frame_id"] == f"vehicle-{system}"]
        at = np.array([[one["translation"][axis] for axis in "xyz"] for one in told])
        np.testing.assert_allclose(at, flight["position"][:, k], atol=1e-4)
        matrix = matrices(np.array([[one["rotation"][axis] for axis in "wxyz"] for one in told]))
        nose, up = matrix[..., 0], matrix[..., 2]
        bearing = np.arctan2(nose[:, 1], nose[:, 0])
        assert np.abs(np.angle(np.exp(1j * (bearing - flight["yaw"][:, k])))).max() < 1e-5
        assert np.abs(np.arccos(np.clip(up[:, 2], -1.0, 1.0)) - flight["tilt"][:, k]).max() < 2e-3
        # Who speeds up leans that way.
        pull = np.gradient(flight["velocity"][:, k], 0.02, axis=0)[:, :2]
        strong = np.linalg.norm(pull, axis=1) > 1.5
        assert strong.sum() > 10
        aligned = (pull * up[:, :2]).sum(axis=1) / np.linalg.norm(pull, axis=1)
        assert (aligned[strong] > 0.0).mean() > 0.9


def test_everything_to_be_seen_hangs_on_a_frame_that_is_there(found: Content) -> None:
    frames = {one["child_frame_id"] for _, value in found.values["/tf"] for one in value["transforms"]}
    assert frames == {"vehicle-11", "vehicle-12", "vehicle-13", "target", "moving-190", "moving-191"}
    seen = {topic.removeprefix("/scene/") for topic in found.values if topic.startswith("/scene/")}
    assert seen == SCENES
    for scene in SCENES:
        for _, value in found.values[f"/scene/{scene}"]:
            for entity in value["entities"]:
                assert entity["frame_id"] in frames | {"fleet"}
    shells = found.values["/scene/vehicles"][0][1]["entities"][0]["spheres"]
    assert shells[0]["size"] == {"x": 0.5, "y": 0.5, "z": 0.5}
    assert shells[0]["color"]["a"] < 0.5


def test_a_vehicle_is_a_multirotor_with_the_rotors_of_its_file(found: Content) -> None:
    of = load(find("vehicles", "firefly"), VehicleConfig)
    (entity, *_) = found.values["/scene/vehicles"][0][1]["entities"]
    rotors = [
        one for one in entity["cylinders"] if one["size"]["x"] > 0.25 * of.span and one["size"]["z"] < 0.01
    ]
    places = sorted((one["pose"]["position"]["x"], one["pose"]["position"]["y"]) for one in rotors)
    # Foxglove's frame has y to the left, the file to the right.
    expected = sorted((rotor.position[0], -rotor.position[1]) for rotor in of.rotors)
    np.testing.assert_allclose(places, expected, atol=1e-3)
    assert len(entity["cubes"]) == len(of.rotors)
    reach = max(np.hypot(x, y) for x, y in places) + 0.5 * rotors[0]["size"]["x"]
    assert 2.0 * reach == pytest.approx(of.span, abs=2e-3)
    color = [rotors[0]["color"][part] for part in "rgb"]
    assert color == pytest.approx(np.array(rgb(VEHICLES[0])) / 255.0, abs=1e-3)


def test_planned_paths_begin_where_the_vehicles_are(found: Content, flight: dict[str, np.ndarray]) -> None:
    drawn, last = 0, -1
    for time, value in found.values["/scene/plans"]:
        assert time - last >= 200_000_000 or last < 0
        last = time
        row = int(np.argmin(np.abs(flight["time_s"] - (time / 1e3 - flight["start_us"]) / 1e6)))
        for k, entity in enumerate(value["entities"]):
            assert entity["id"] == f"plan-{SYSTEMS[k]}"
            for line in entity["lines"]:
                begin = [line["points"][0][axis] for axis in "xyz"]
                # A plan is up to 0.1 s old, and sent with 0.1 m at most of difference to the true position.
                assert np.linalg.norm(begin - flight["position"][row, k]) < 1.0
                drawn += 1
    assert drawn > 20


def test_the_layout_shows_channels_that_are_there(run: Path, tmp_path: Path) -> None:
    told = content(exported(run, tmp_path / "flight.mcap"))
    layout = json.loads((tmp_path / "flight.foxglove.json").read_text())
    panels = layout["configById"]

    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(layout["layout"])) == sorted(panels)
    for name, panel in panels.items():
        for path in panel.get("paths", []):
            topic, *fields = path["value"].split(".")
            value: Any = told.values[topic][-1][1]
            for field in fields:
                value = value[field]
            assert isinstance(value, float), name
    shown = {topic for topic, of in panels["3D!scene"]["topics"].items() if of["visible"]}
    assert {f"/scene/{name}" for name in SCENES - {"paths"}} <= shown
    # An export writes over nothing, neither over a layout.
    (tmp_path / "flight.mcap").unlink()
    with pytest.raises(InputError, match=r"flight\.foxglove\.json: exists"):
        exported(run, tmp_path / "flight.mcap")


# What was said


def test_every_message_of_the_logs_is_there(found: Content, run: Path) -> None:
    for system in SYSTEMS:
        prefix = f"/mavlink/vehicle-{system}/"
        waiting = {topic: iter(rows) for topic, rows in found.values.items() if topic.startswith(prefix)}
        expected = received(run / f"vehicle-{system}.tlog")
        assert sum(len(found.values[topic]) for topic in waiting) == len(expected)
        for message in expected:
            time, value = next(waiting[f"{prefix}{message.system}/{message.component}/{message.name}"])
            assert time == 1000 * message.time
            assert value.pop("_link") == message.link
            expected_value = dict(as_json(message.fields))
            assert value.keys() == expected_value.keys()
            assert all(equal(value[name], wanted) for name, wanted in expected_value.items())
        fixes = found.values[f"/fix/{system}"]
        own = [one for one in expected if one.name == "GLOBAL_POSITION_INT" and one.link == 0]
        assert [fix["latitude"] for _, fix in fixes] == [one.fields["lat"] / 1e7 for one in own]


def as_json(fields: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """What JSON can hold of a message: bytes in base 64, and no NaN."""
    for name, value in fields.items():
        items = value if isinstance(value, list) else [value]
        if all(isinstance(item, str) or math.isfinite(item) for item in items):
            yield name, value


def equal(found: Any, expected: Any) -> bool:
    """Numbers of single precision are told with as many digits as they need, bytes in base 64."""
    if isinstance(found, str) and isinstance(expected, list):
        return list(b64decode(found)) == expected
    if isinstance(expected, float):
        return bool(np.float32(found) == np.float32(expected))
    return bool(found == expected)


def test_any_message_of_the_dialect_can_be_told(tmp_path: Path) -> None:
    log = tmp_path / "all.tlog"
    everything(log)
    told = content(exported(log, tmp_path / "all.mcap"))
    for schema, _, message in told.messages:
        Draft202012Validator(json.loads(schema.data)).validate(json.loads(message.data))
    waiting = {topic: iter(rows) for topic, rows in told.values.items()}
    for message in received(log):
        _, value = next(waiting[f"/mavlink/1/1/{message.name}"])
        del value["_link"]
        for name, expected in as_json(message.fields):
            assert equal(value.pop(name), expected), (message.name, name)
        assert value == {}


# Attitude


def matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4), w x y z."""
    w, v = q[:, 0], q[:, 1:]
    cross = np.zeros((len(q), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    result: np.ndarray = np.eye(3) + 2.0 * (w[:, None, None] * cross + cross @ cross)
    return result


ANGLE = st.floats(-math.pi, math.pi)


@given(ANGLE, ANGLE, st.floats(0.0, math.pi))
def test_a_quaternion_has_the_nose_and_the_up_it_was_made_from(yaw: float, side: float, tilt: float) -> None:
    up = np.array([[math.sin(tilt) * math.cos(side), math.sin(tilt) * math.sin(side), math.cos(tilt)]])
    (turned,) = matrices(quaternions(np.array([yaw]), up))
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(turned[:, 2], up[0], atol=1e-9)
    if abs(up[0, 2]) > 2e-3:
        ahead = turned[:2, 0] / np.linalg.norm(turned[:2, 0])
        np.testing.assert_allclose(ahead, [math.cos(yaw), math.sin(yaw)], atol=1e-6)


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE)
def test_down_is_where_the_quaternion_of_the_same_angles_puts_it(
    roll: float, pitch: float, yaw: float
) -> None:
    (turned,) = matrices(np.array([quaternion(roll, pitch, yaw)]))
    np.testing.assert_allclose(turned[:, 2], along_down(roll, pitch, yaw), atol=1e-12)
    # −π and π are one direction.
    off = math.remainder(math.atan2(turned[1, 0], turned[0, 0]) - yaw, math.tau)
    assert abs(off) < 1e-9
