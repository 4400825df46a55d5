"""The doctor's verdict on five recorded logs, against what is true in them, written down by hand.

What holds of a piece holds of the whole log that it was cut from; those are read where they lie beside the
checkout. Rates are those of the whole.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import pytest

from mavlink_bridge.links.endpoints import Replay
from outrider.doctor.command import of_log
from outrider.doctor.finding import Severity, Verdict
from outrider.doctor.page import show
from tests.mavlink_bridge.recorded_logs import PIECES, ROOT, SHIPPED
from tests.outrider.doctor.bench import blocking, found, warnings
from tests.outrider.said import Run

CUT = ROOT / "tests" / "data" / "doctor"
WHOLE = ROOT.parent / "shared" / "tlogs"
OK, NOTE, WARNING, BLOCKING = Severity.OK, Severity.NOTE, Severity.WARNING, Severity.BLOCKING


class Truth(NamedTuple):
    """``says``: words of a finding, how much it matters, and words of its reason or of what to do."""

    ready: bool
    blocking: tuple[str, ...]
    says: tuple[tuple[str, Severity, str], ...]
    rates: tuple[tuple[str, Severity], ...]


def copter(system: int) -> Truth:
    """Booted before the log begins; RTK simulated; armed, flown, landed; nobody read parameters."""
    return Truth(
        True,
        (),
        (
            (f"ArduPilot 4.6.3, quadrotor, system {system}", OK, "measured"),
            ("mode LAND, disarmed, on the ground", OK, "ends"),
            ("the pre-arm check has passed", OK, "armed"),
            ("the estimator has an absolute position", OK, ""),
            ("GPS: RTK fixed, 10 satellites", OK, ""),
            ("battery: 8", OK, "Enough"),  # 86 % in one, 85 % in the other
            ("origin: 47.3977000°, 8.5456000°, 488.1 m", OK, ""),
            ("home is 0.0 m from the origin, 0.0 m below it", OK, ""),
            ("local and global position agree (0.0 m apart)", OK, ""),
            ("its clock runs", OK, "ours"),
            ("GUID_TIMEOUT is not in the log", NOTE, "3 s by default"),
            ("255/191 sends set-points", NOTE, "steered"),
        ),
        (
            ("LOCAL_POSITION_NED at 50 Hz", OK),
            ("ATTITUDE at 50 Hz", OK),
            ("EXTENDED_SYS_STATE at 2 Hz", OK),
            ("GLOBAL_POSITION_INT at 10 Hz", OK),
        ),
    )


TRUTHS = {
    ("copter-full", "ap_copter463_guided_full"): copter(9),
    ("copter-pvy", "ap_copter463_guided_pvy"): copter(1),
    # Flown in OFFBOARD. Set-points were stopped on purpose three times in flight, and it fell to POSCTL each
    # time; the recording computer did not quite keep up; nobody asked for the origin, nor for a parameter.
    ("px4-pvay", "px4_1161_offboard_pvay"): Truth(
        True,
        (),
        (
            ("PX4 1.16.1, quadrotor, system 1", OK, "measured"),
            ("mode OFFBOARD, disarmed, on the ground", OK, "ends"),
            ("the pre-arm check has passed", OK, "lost 3 times"),
            ("the estimator has an absolute position", OK, ""),
            ("GPS: 3D fix, 10 satellites", OK, "position_sigma"),
            ("battery: 50%", OK, ""),
            ("it fell out of the mode that set-points steer, 3 times", WARNING, "COM_OBL_RC_ACT to 5"),
            ("no GPS_GLOBAL_ORIGIN; worked out from two positions: 47.39769", WARNING, "REQUEST_MESSAGE 49"),
            ("COM_OBL_RC_ACT is not in the log", WARNING, "sinks at 0.6 m/s"),
            ("its clock runs 0.989 times", NOTE, "simulation"),
            ("1/191 sends set-points", NOTE, "steered"),
        ),
        (
            ("LOCAL_POSITION_NED at 49.2 Hz", OK),
            ("ATTITUDE at 100 Hz", OK),
            ("SYS_STATUS at 5 Hz", OK),
            ("GLOBAL_POSITION_INT at 50 Hz", OK),
        ),
    ),
    # A real one of 2014 or so: old firmware, MAVLink 1, restarted by command at 235 s, flown till its battery
    # was low, the link gone for the last 325 s. Its ground station is 255, and it watches for 253.
    ("quadrotor", "dronekit_flight_replay"): Truth(
        False,
        (
            "its state is critical",
            "SYS_STATUS does not tell whether it may be armed",
            "the estimator has no absolute",
        ),
        (
            ("ArduPilot, quadrotor; its version is not told", NOTE, ""),
            ("its state is critical", BLOCKING, "Low Battery!"),
            ("the estimator has no absolute position", BLOCKING, "constant position"),
            ("it speaks MAVLink 1", WARNING, "SERIALn_PROTOCOL = 2"),
            ("it says nothing in the last 325 s", WARNING, ""),
            ("GPS: 3D fix, 7 satellites, poor", WARNING, "HDOP 2.6"),
            ("battery: 20%", WARNING, ""),
            ("vz positive when it climbs", WARNING, "velocity_up"),
            ("FS_GCS_ENABLE = 1", WARNING, "253"),
            ("its clock went back: it was started again", NOTE, ""),
            ("mode STABILIZE, disarmed", OK, ""),
            ("ARMING_CHECK = 127", OK, ""),
            ("it follows up to 1 m/s², 5 m/s³, 10 m/s and 45° of tilt", WARNING, ""),
            ("WPNAV_ACCEL = 100, stock is 250", WARNING, "stops in 13.0 m"),
            ("a ground station: 255/0", NOTE, ""),
        ),
        (("2% of the frames are damaged (1314)", WARNING),),
    ),
    # A submarine that never saw a satellite, with the bytes of a damaged recording.
    ("submarine", "ardusub_corrupt"): Truth(
        False,
        (
            "ArduPilot, submarine: no multicopter",
            "the estimator has no absolute position",
            "GPS: no fix in three dimensions, 0 satellites",
            "the log has no GPS_GLOBAL_ORIGIN",
            "LOCAL_POSITION_NED does not come",
        ),
        (
            ("ArduPilot 4.1.0, submarine, system 1", WARNING, "Older"),
            ("mode 19, disarmed", OK, ""),
            ("the battery's charge is not told, 15.", NOTE, "BATT_MONITOR"),
            ("FS_EKF_ACTION = 0", WARNING, "Set FS_EKF_ACTION"),
            ("a ground station: 255/190", NOTE, ""),
        ),
        (
            ("ATTITUDE at 19.8 Hz", OK),
            ("4% of the frames are damaged (1967)", WARNING),
            ("another component: 1/100, camera", NOTE),
            ("another component: 1/194, onboard controller", NOTE),
        ),
    ),
}


def verdict_of(path: Path) -> Verdict:
    return of_log(Replay(str(path)), None)


def holds(verdict: Verdict, truth: Truth) -> None:
    assert verdict.ready is truth.ready, blocking(verdict)
    assert len(blocking(verdict)) == len(truth.blocking), blocking(verdict)
    for words in truth.blocking:
        assert found(verdict, words).severity is BLOCKING
    for words, severity, more in truth.says:
        finding = found(verdict, words)
        assert finding.severity is severity, finding
        assert more in f"{finding.why} {finding.do}", finding


@pytest.mark.parametrize(("piece", "truth"), [(names[0], truth) for names, truth in TRUTHS.items()])
def test_the_verdict_on_a_piece_is_right(piece: str, truth: Truth) -> None:
    holds(verdict_of(CUT / f"{piece}.tlog.gz"), truth)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "truth"), [(names[1], truth) for names, truth in TRUTHS.items()])
def test_the_verdict_on_the_whole_log_is_right(name: str, truth: Truth) -> None:
    path = WHOLE / f"{name}.tlog"
    if not path.exists():
        pytest.skip("the whole logs do not lie beside the checkout")
    verdict = verdict_of(path)
    holds(verdict, truth)
    for words, severity in truth.rates:
        assert found(verdict, words).severity is severity


def test_nothing_is_wrong_that_was_not_said() -> None:
    for names, truth in TRUTHS.items():
        verdict = verdict_of(CUT / f"{names[0]}.tlog.gz")
        known = [words for words, severity, _ in truth.says if severity is WARNING]
        # A piece is thinned, and it holds no EXTENDED_SYS_STATE where the log has none.
        thinned = (" Hz", "EXTENDED_SYS_STATE does not come", "has stopped", "no GPS_GLOBAL_ORIGIN")
        for what in warnings(verdict):
            assert any(words in what for words in (*known, *thinned)), what


@pytest.mark.parametrize("path", [*PIECES, SHIPPED], ids=lambda path: path.stem)
def test_every_other_log_of_ours_gets_a_verdict(path: Path) -> None:
    verdict = verdict_of(path)
    assert verdict.findings
    if path == SHIPPED:  # a target's positions, and nothing else
        assert blocking(verdict) == ["no autopilot's HEARTBEAT; only 1/1 can be heard"]


def test_json_of_a_log(run: Run) -> None:
    status, out, err = run("doctor", f"tlog:{CUT / 'quadrotor.tlog.gz'}", "--json")
    value = json.loads(out)
    assert (status, err, list(value), value["ready"]) == (1, "", ["ready", "findings"], False)
    severities = [finding["severity"] for finding in value["findings"]]
    order = ["blocking", "warning", "note", "ok"]
    assert severities == sorted(severities, key=order.index)
    for finding in value["findings"]:
        assert list(finding) == ["what", "severity", "why", "do"]
        assert finding["what"]
        assert finding["why"]
        assert finding["do"] or finding["severity"] in ("ok", "note")
    status, out, _ = run("doctor", f"tlog:{CUT / 'copter-full.tlog.gz'}")
    assert status == 0
    assert ": ready for an escort (" in out


def test_the_line_of_the_verdict_is_whole_for_a_name_of_any_length(
    capsys: pytest.CaptureFixture[str],
) -> None:
    verdict = verdict_of(CUT / "quadrotor.tlog.gz")
    for length in range(200):
        name = "tlog:" + "a" * length
        show(name, verdict)
        assert capsys.readouterr().out.startswith(f"{name}: NOT ready for an escort (3 blocking, ")
