"""Where moments come from beside flights: played runs, links that are listened to, a page of memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.values.components import COMPONENT
from mavlink_bridge.links.endpoints import parse_endpoint
from mavlink_bridge.links.link import LinkCounters
from mavlink_bridge.loops.lockstep import Direction
from mavlink_bridge.messages import GlobalPosition, Heartbeat, Source, Tunnel
from mavlink_bridge.node import Datagram
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, pack, quantise
from outrider.realtime.view_page import Window
from outrider.runs import names
from outrider.scene.changes import Change
from outrider.scene.companion_snapshot import MODES, CompanionSnapshot
from outrider.scene.datagram_channel import DatagramChannel, pair
from outrider.scene.recorded import Record
from outrider.scene.scene import Scene, Solid
from outrider.scene.snapshot import KNOTS, NO_PLAN, Snapshot, State
from outrider.scene.view_commands import ViewCommands
from outrider.simulation.flight import Flight
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from outrider.view.listener import Listener
from outrider.view.live import Begin, LiveSource, packed
from outrider.view.missing_peers import MissingPeers
from outrider.view.player import Player, load
from tests.outrider.report.runs import WrittenRun, leave
from tests.outrider.said import Run
from tests.outrider.shipped import FIREFLY, LOGS
from tests.outrider.view.flights import small


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> WrittenRun:
    return leave(tmp_path_factory.mktemp("view") / "run")


def seen(player: Player, wall: float) -> list[Snapshot]:
    return [one for one in player.poll(wall) if isinstance(one, Snapshot)]


def test_a_run_is_played_as_it_was(made: WrittenRun) -> None:
    player = load(made.directory)
    first, *_ = player.poll(0.0)
    assert isinstance(first, Scene)
    assert first.systems == (11, 12, 13)
    assert player.span == pytest.approx((made.time[0], made.time[-1]))
    for wall in (0.5, 1.0, 4.0):
        (moment,) = seen(player, wall)
        assert moment.time == pytest.approx(-1.0 + wall)
        row = int(np.searchsorted(made.time, moment.time + 1e-6, side="right")) - 1
        np.testing.assert_allclose(moment.position, made.position[row], atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(moment.attitude, axis=1), 1.0, atol=1e-6)


def test_pause_step_speed_and_a_time_that_is_chosen(made: WrittenRun) -> None:
    player = load(made.directory)
    player.poll(0.0)
    player.command(ViewCommands(paused=True), None)
    assert seen(player, 5.0) == []
    player.command(ViewCommands(paused=True, steps=2), None)
    assert [one.time for one in seen(player, 6.0)] == pytest.approx([-0.8])
    player.command(ViewCommands(speed=4.0, steps=2), None)
    assert [one.time for one in seen(player, 6.5)] == pytest.approx([1.2])
    player.command(ViewCommands(paused=True, steps=2), 3.0)
    found = seen(player, 7.0)
    # Of what was before there is a trail again.
    assert found[-1].time == 3.0
    times = [one.time for one in found]
    assert times == sorted(times)
    assert times[0] == pytest.approx(player.span[0])
    player.command(ViewCommands(speed=None, steps=2), None)
    assert seen(player, 100.0)[-1].time == player.span[1]
    assert seen(player, 101.0) == []


def test_who_is_disarmed_flies_no_plan() -> None:
    plan = np.ones((KNOTS, 6), dtype=np.float32)
    flying, landed = (Heartbeat(Source(1, 1), 2, 12, mode, 6 << 16, 4) for mode in (0x80, 0))
    flown = Record([0, 500_000], [plan, plan], [], [], [0, 1_000_000], [flying, landed], {}, [], [])
    assert flown.mode(-1) == ""
    assert flown.mode(999_999) == "OFFBOARD"
    assert np.isfinite(flown.plan(999_999)).all()
    assert flown.mode(1_000_000) == "OFFBOARD, disarmed"
    assert np.isnan(flown.plan(1_000_000)).all()
    # An autopilot that fell silent says nothing any more.
    assert flown.mode(4_000_000) == "OFFBOARD, disarmed"
    assert flown.mode(4_000_001) == ""


def test_a_real_run_has_plans_attitudes_and_ages(tmp_path: Path) -> None:
    directory = tmp_path / "run"
    directory.mkdir()
    swarm.fly(Prepared(small(), FIREFLY), 1, directory, lambda _stage, _seconds: None)
    player = load(directory)
    moment = player.moment(1.5)
    assert np.isfinite(moment.plan).all()
    assert np.linalg.norm(moment.plan[:, 0, :3] - moment.position, axis=1).max() < 1.0
    for state in moment.states:
        assert state.mode == "GUIDED"
        assert 0.0 <= state.age_s < 1.0
        assert state.plan_ms > 0.0
    # They lean into their way: not all of them stand upright.
    assert np.abs(moment.attitude[:, 1:3]).max() > 0.01


def test_what_is_no_run_is_said_in_one_line(tmp_path: Path, run: Run) -> None:
    (tmp_path / "empty").mkdir()
    cases: list[tuple[list[str], str]] = [
        ([str(tmp_path / "nowhere")], "no such file or directory"),
        ([str(tmp_path / "empty")], "not a run directory"),
        (["udpout:127.0.0.1:14550"], "sends nothing"),
        (["udpin:127.0.0.1:0,127.0.0.1:9"], "sends nothing"),
        (["udpin:127.0.0.1:99999"], "outside 0…65535"),
        (["mcast:", "nonsense:"], "no endpoint begins with"),
        (["udpin:127.0.0.1:0", "--html", "x.html"], "allowed: a run directory"),
        (["tlog:nowhere.tlog"], "nowhere.tlog"),
    ]
    for arguments, said in cases:
        ended = run("view", *arguments)
        assert (ended.status, ended.out, ended.err.count("\n")) == (2, "", 1), arguments
        assert said in ended.err


class Receiver:
    """A link on which things arrive, and nothing may be sent."""

    def __init__(self) -> None:
        self.arrived: list[bytes] = []

    counters = LinkCounters(0, 0, 0)

    def fileno(self) -> None:
        return None

    def receive(self) -> list[bytes]:
        found, self.arrived = self.arrived, []
        return found

    def send(self, data: bytes) -> None:
        raise AssertionError("a view sends nothing")

    def close(self) -> None:
        pass


class Caller(Receiver):
    """A link that has no peer for a reason."""

    failure = ""


def test_why_a_link_has_no_peer_is_said_once_for_each_reason(capsys: pytest.CaptureFixture[str]) -> None:
    called, heard = Caller(), Receiver()
    missing = MissingPeers(
        [parse_endpoint("tcp:127.0.0.1:9"), parse_endpoint("udpin:127.0.0.1:8")], [called, heard]
    )
    said = []
    for failure in (
        "",
        "Connection refused",
        "Connection refused",
        "No route to host",
        "",
        "Connection refused",
    ):
        called.failure = failure
        missing.say()
        said.append(capsys.readouterr().err)
    place = "outrider view: tcp:127.0.0.1:9: no connection: "
    again = "; it is tried again every second\n"
    refused, no_route = f"{place}Connection refused{again}", f"{place}No route to host{again}"
    assert said == ["", refused, "", no_route, "", refused]


def test_a_view_of_a_port_where_nobody_listens_says_so(run: Run) -> None:
    ended = run("view", "tcp:127.0.0.1:9", "--seconds", "0.5")
    assert ended.status == 0
    assert ended.err.count("tcp:127.0.0.1:9: no connection: Connection refused") == 1


def test_without_the_extra_it_says_what_to_install(
    run: Run, monkeypatch: pytest.MonkeyPatch, made: WrittenRun
) -> None:
    import sys

    for name in [*sys.modules]:
        if name.startswith("outrider.view") or name.partition(".")[0] == "viser":
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "viser", None)
    for arguments in (("view", str(made.directory)), ("swarm", "antipodal-8", "--view")):
        ended = run(*arguments)
        assert (ended.status, ended.err.count("\n")) == (3, 1)
        assert "pip install '.[view]'" in ended.err
    assert not Path("runs").exists()


def test_a_run_becomes_one_file(run: Run, made: WrittenRun, tmp_path: Path) -> None:
    page = tmp_path / "out.html"
    ended = run("view", str(made.directory), "--html", str(page))
    assert (ended.status, ended.out) == (0, f"{page}\n")
    text = page.read_text()
    assert text.lstrip().lower().startswith("<!doctype html>")
    assert "__VISER_EMBED_DATA__" in text
    again = run("view", str(made.directory), "--html", str(page))
    assert again.status == 2
    assert "is there already" in again.err


class Overhears:
    """What is said on the swarm's and target's links and by autopilots, for a view; and the truth."""

    def __init__(self, flight: Flight, ear: Receiver, listener: Listener) -> None:
        self._flight, self._ear, self._listener = flight, ear, listener
        self._last = 0
        self.shown: list[tuple[Any, Snapshot]] = []
        self.scenes: list[Scene] = []

    def begin(self, now: int, node: str) -> None:
        if now - self._last < 40_000 or node != names.OPERATOR:
            return
        self._last = now
        for one in self._listener.poll(1e-6 * now):
            if isinstance(one, Scene):
                self.scenes.append(one)
            else:
                self.shown.append((self._flight.truth.latest(), one))

    def __call__(self, now: int, node: str, direction: Direction, datagrams: Sequence[Datagram]) -> None:
        for link, data in datagrams:
            if direction == "out" and link in ("swarm", "target", "autopilot"):
                self._ear.arrived.append(data)


def overheard(of: Any) -> Overhears:
    ear = Receiver()
    listener = Listener([ear], [True], 10, "")
    flight = Flight(of, FIREFLY, 1, LOGS, stopwatch=lambda: 0)
    found = Overhears(flight, ear, listener)
    flight.run((found,))
    return found


@pytest.mark.parametrize("avoidance", ["field", "certified"])
def test_who_listens_sees_the_flight_and_is_silent(avoidance: str) -> None:
    of = small(cap_s=2.0, companion={"avoidance": avoidance, "rates": {"replan_us": 50_000}})
    found = overheard(of)
    scene = found.scenes[-1]
    assert scene.systems == tuple(of.systems)
    assert (scene.step_s is not None) == (avoidance == "certified")
    (places, _, target), last = found.shown[-1]
    # Its frame is another than the fleet's: by a constant.
    off = last.position - places
    np.testing.assert_allclose(off - off.mean(axis=0), 0.0, atol=0.15)
    assert target is not None
    np.testing.assert_allclose(last.target - target, off.mean(axis=0), atol=0.15)
    assert np.isfinite(last.plan).all()
    begin = last.plan[:, :4, :3] - last.position[:, None]
    assert np.linalg.norm(begin, axis=2).min(axis=1).max() < 1.0
    np.testing.assert_allclose(np.linalg.norm(last.attitude, axis=1), 1.0, atol=1e-5)
    assert all(state.mode == "GUIDED" for state in last.states)


@pytest.mark.parametrize("armed", [True, False])
def test_who_listens_sees_no_plan_of_who_is_disarmed(armed: bool) -> None:
    ear, codec, own = Receiver(), Codec(), Source(1, 1)
    place = GlobalPosition(own, 1, 47.4, 8.5, 500.0, 10.0, (0.0, 0.0, 0.0), 0.0)
    plan = pack(quantise(0, 100_000, np.zeros(3), np.zeros(3), np.zeros((16, 3)), 1))
    said = [
        place,
        Heartbeat(own, 2, 3, 0x80 if armed else 0, 4, 4),
        Tunnel(Source(1, COMPONENT), 0, 0, PAYLOAD_TYPE, plan),
    ]
    ear.arrived = [codec.encode(message) for message in said]
    *_, moment = Listener([ear], [True], 10, "").poll(1.0)
    assert isinstance(moment, Snapshot)
    assert np.isfinite(moment.plan).all() == armed
    assert moment.states[0].mode == ("GUIDED" if armed else "GUIDED, disarmed")


@given(st.lists(st.binary(max_size=300), max_size=20))
def test_whatever_is_heard_harms_nobody(received: list[bytes]) -> None:
    ear = Receiver()
    listener = Listener([ear], [True], 10, "")
    ear.arrived = list(received)
    assert listener.poll(0.0) == ()


WORDS = st.sampled_from(MODES)


@given(st.integers(0, 2), WORDS, st.floats(0.0, 100.0), st.integers(0, 1000))
def test_a_row_of_the_window_is_as_it_was_shown(k: int, mode: str, age: float, held: int) -> None:
    window = Window(3)
    plan = np.arange(6.0 * KNOTS, dtype=np.float32).reshape(KNOTS, 6)
    window.show_companion(k, CompanionSnapshot(State(mode, age, 1.5, held), plan))
    window.show_attitude(k, np.array([1.0, 0.0, 0.0, 0.0]))
    assert window.states[k] == State(mode, age, 1.5, held)
    assert (window.plans[k] == plan).all()
    others = [j for j in range(3) if j != k]
    assert all(window.states[j].mode == "" for j in others)
    assert np.isnan(window.attitudes[others]).all()
    assert NO_PLAN.shape == plan.shape


def test_commands_through_the_window() -> None:
    window = Window(1)
    assert (window.commands, window.methods, window.loss, window.moves) == (0, (), None, 0)
    window.command(Change(methods="swivel+tangential"))
    window.command(Change(loss=0.25))
    window.command(Change(target=(1.0, 2.0, 3.0)))
    assert (window.commands, window.loss, window.moves) == (3, 0.25, 1)
    assert set(window.methods) == {"swivel", "tangential"}
    assert window.place.tolist() == [1.0, 2.0, 3.0]
    window.command(Change(methods="baseline"))
    assert window.methods == ("baseline",)


@pytest.mark.parametrize("count", [0, 20_000])
def test_a_flight_among_any_number_of_boxes_is_seen(count: int) -> None:
    """A datagram holds no thousands of boxes."""
    ours, theirs = map(DatagramChannel, pair())
    boxes = tuple(Solid("box", (float(k), 0.0, 1.0), size=(0.5, 0.5, 2.0), yaw=0.1) for k in range(count))
    begun = Begin(Scene("many", (11,), 1, solids=boxes), ViewCommands(paused=True))
    data, filed = packed(begun)
    assert (filed is not None) == (count > 0)
    assert len(data) < 100_000
    assert ours.send(data)
    source = LiveSource(theirs, load)
    (scene,) = source.poll(0.0)
    assert isinstance(scene, Scene)
    assert scene.solids == boxes
    assert source.begin == begun.commands
    assert filed is None or not filed.exists()
    # A file that somebody removed is a scene that is not seen, and no more than that.
    ours.send(data)
    assert len(source.poll(0.0)) == (count == 0)
    ours.close()
    theirs.close()
