"""What the doctor says about a vehicle's camera: what it speaks, how accurate, and of what time."""

from __future__ import annotations

from typing import Any

import pytest

from mavlink_bridge.messages import (
    CameraFovStatus,
    CameraInformation,
    CameraTrackingGeo,
    CameraTrackingImage,
    CommandLong,
    GlobalPosition,
    HilState,
    Message,
    Source,
)
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.framing import Frame
from outrider.doctor.finding import Severity
from sitl.camera.scene import LINK as SIGHT
from sitl.camera.scene import Scene
from sitl.config.autopilot import AutopilotConfig
from sitl.node import Autopilot
from sitl.values.camera import CameraConfig
from tests.outrider.doctor.bench import Bench, autopilot, found
from tests.sitl.autopilot_rig import FIREFLY, SITE

OTHER = Source(11, 101)
OK, NOTE, WARNING = Severity.OK, Severity.NOTE, Severity.WARNING


class Seeing(Autopilot):
    """A vehicle on the ground that looks at a target in front of it."""

    def step(self, now: int, inbox: Any) -> list[Datagram]:
        place = SITE.to_geodetic((0.0, 8.0, 0.0))
        truth = HilState(Source(10, 1), now, *place, (0.0, 0.0, 0.0))
        light = Datagram(SIGHT, Codec().encode(truth))
        return [one for one in super().step(now, [*inbox, light]) if one.link != SIGHT]


def bench(passes: Any = lambda _frame: True, **camera: Any) -> Bench:
    place = {"latitude": SITE.latitude, "longitude": SITE.longitude, "altitude": SITE.altitude}
    config = AutopilotConfig(system_id=11, streams="normal", epoch=1_700_000_000_000_000, **place)
    vehicle = FIREFLY.model_copy(update={"camera": CameraConfig(**camera)})
    rig = Bench(Seeing(config, vehicle, SITE, 1, scene=Scene(10)), passes=passes)
    rig.run(2.0)
    return rig


def test_a_camera_with_everything_is_in_order() -> None:
    verdict = bench(latency_ms=140.0).consult()
    assert found(verdict, "camera 11/100 speaks CAMERA_TRACKING_GEO_STATUS (276)").severity is OK
    assert "at 10 Hz, with all accuracies" in found(verdict, "(276)").what
    told = found(verdict, "camera 11/100 tells of its images")
    assert told.severity is OK
    # To the step of the doctor and the vehicle, 20 ms.
    assert 120 <= int(told.what.split("images ")[1].split()[0]) <= 160


def test_accuracies_that_are_not_filled_in_are_named() -> None:
    finding = found(bench(accuracy=False).consult(), "(276)")
    assert finding.severity is WARNING
    assert finding.what.endswith("without h_acc, v_acc, dist, hdg, hdg_acc")


def test_images_without_a_time_are_a_note() -> None:
    verdict = bench(fov_status=False).consult()
    assert found(verdict, "does not tell when its images were taken").severity is NOTE


def test_a_camera_that_speaks_of_its_image_alone_is_known_by_its_optics() -> None:
    rig = bench(speaks="image", fov_status=False)
    verdict = rig.consult()
    assert found(verdict, "CAMERA_TRACKING_IMAGE_STATUS (275) alone").severity is NOTE
    assert found(verdict, "does not tell where it looks").severity is NOTE
    assert not [finding for finding in verdict.findings if "optics" in finding.what]
    optics = found(verdict, "does not tell its angles of view with its images")
    assert optics.severity is NOTE
    # 1280 × 720 pixels, 70° across.
    assert "target_source.optics: {width_deg: 70.0, height_deg: 43.0}" in optics.do
    asked = [m for m in rig.received if isinstance(m, CommandLong) and m.target_component == 100]
    assert [m.params[0] for m in asked] == [259.0]


def test_optics_that_do_not_come_are_a_warning_and_asked_for_three_times() -> None:
    def deaf(frame: Frame) -> bool:
        return frame.message_id != 259

    rig = bench(speaks="image", fov_status=False, passes=deaf)
    assert found(rig.consult(), "does not tell its optics").severity is WARNING
    asked = [m for m in rig.received if isinstance(m, CommandLong) and m.target_component == 100]
    assert len(asked) == 3


def test_a_gimbal_tells_where_the_camera_looks() -> None:
    verdict = bench(speaks="image", fov_status=False, mount={"kind": "gimbal"}).consult()
    assert not [finding for finding in verdict.findings if "where it looks" in finding.what]


def test_a_camera_that_sees_nothing_is_a_note_and_a_vehicle_without_has_none() -> None:
    assert found(bench(range=2.0).consult(), "tells of no target").severity is NOTE
    verdict = Bench(autopilot()).consult()
    assert not [finding for finding in verdict.findings if "camera" in finding.what]


def frames(*messages: Message) -> Any:
    codec = Codec()
    return lambda now: [codec.encode(m) for m in messages] if now % 200_000 == 0 else []


@pytest.mark.parametrize(
    ("said", "words", "severity"),
    [
        (CameraTrackingGeo(OTHER, 1, 47.0, 8.0, 400.0, None, 0.0, 0.0), "without h_acc", WARNING),
        (
            CameraTrackingImage(OTHER, 1, 1, 4, (0.5, 0.5), None, None),
            "without a rectangle",
            WARNING,
        ),
    ],
)
def test_another_camera_is_judged_by_what_it_says(said: Message, words: str, severity: Severity) -> None:
    verdict = bench().consult(beside=frames(said))
    finding = next(one for one in verdict.findings if "camera 11/101 speaks" in one.what)
    assert words in finding.what
    assert finding.severity is severity


@pytest.mark.parametrize("stamp", [0, 10**9])
def test_another_clock_than_the_autopilots_is_a_warning(stamp: int) -> None:
    geo = CameraTrackingGeo(OTHER, 1, 47.0, 8.0, 400.0, None, 0.5, 0.5, None, 8.0, 0.0, 0.01)
    view = CameraFovStatus(OTHER, stamp, None, None, (1.0, 0.0, 0.0, 0.0), 1.2, 0.7)
    rig = bench()
    rig.run(5.0)
    finding = found(rig.consult(beside=frames(geo, view)), "camera 11/101 has another clock")
    assert finding.severity is WARNING


@pytest.mark.parametrize(
    ("focal_length", "sensor_size"),
    [(4.0, (0.0, 0.0)), (4.0, (6.0, 0.0)), (4.0, (-6.0, 4.0)), (0.0, (6.0, 4.0)), (-4.0, (6.0, 4.0))],
)
def test_optics_that_are_not_positive_are_unknown(
    focal_length: float, sensor_size: tuple[float, float]
) -> None:
    said = CameraTrackingImage(OTHER, 1, 2, 4, None, None, (0.4, 0.3, 0.6, 0.7))
    about = CameraInformation(OTHER, 0, "", "", 0, focal_length, sensor_size, (1280, 720), 0)
    verdict = Bench(autopilot()).consult(beside=frames(said, about))
    assert found(verdict, "camera 11/101 does not tell its optics").severity is WARNING
    assert not [finding for finding in verdict.findings if "target_source.optics: {" in finding.do]


VIEW = CameraFovStatus(Source(12, 191), 1000, (47.0, 8.0, 400.0), None, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0)
SEEN = CameraTrackingGeo(Source(12, 191), 1, 47.0, 8.0, 400.0, None, 0.5, 0.5, None, 8.0, 0.0, 0.01)
THERE = GlobalPosition(Source(12, 191), 1000, 47.0, 8.0, 400.0, 5.0, (0.0, 0.0, 0.0), None)


def test_what_another_vehicle_forwards_is_judged_as_companions_use_it() -> None:
    whole = found(bench().consult(beside=frames(THERE, VIEW, SEEN)), "forwarder 12/191 of another vehicle")
    assert whole.severity is OK
    assert "(276) at 5 Hz, with all accuracies" in whole.what
    bare = SEEN._replace(vertical_accuracy=None)
    assert found(bench().consult(beside=frames(THERE, VIEW, bare)), "without v_acc").severity is WARNING
    undated = bench().consult(beside=frames(THERE, SEEN))
    assert found(undated, "forwarder 12/191 tells of a target, but not as").severity is WARNING
    assert found(undated, "camera 11/100 speaks").severity is OK


@pytest.mark.parametrize("component", [100, 191])
def test_a_camera_with_the_id_of_no_vehicle_is_a_warning(component: int) -> None:
    said = SEEN._replace(source=Source(77, component))
    finding = found(bench().consult(beside=frames(said)), f"77/{component} has the system id of no vehicle")
    assert finding.severity is WARNING
    assert "(here 11)" in finding.do


def test_detections_of_another_component_of_the_vehicle_are_a_forwarders() -> None:
    verdict = bench().consult(beside=frames(SEEN._replace(source=Source(11, 191))))
    assert found(verdict, "forwarder 11/191 speaks CAMERA_TRACKING_GEO_STATUS (276)").severity is OK
    assert found(verdict, "forwarder 11/191 does not tell when its images were taken").severity is NOTE
