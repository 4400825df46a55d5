"""``outrider replay --certify`` on flown runs, with logs as they are, damaged, forged or missing."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified import negotiation
from companion.avoidance.certified.agreed_planes import AgreedPlanes, made
from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.pair import Agreement, Pair
from companion.avoidance.certified.reservation import Reservation
from companion.config.certified import CertifiedConfig
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandLong, Message, Source, Tunnel
from mavlink_bridge.tlog.log import Record, TlogWriter, read_tlog
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, pack, unpack
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.plan import PAYLOAD_TYPE
from outrider.__main__ import main
from outrider.certify.command import show
from outrider.certify.reading import read
from outrider.certify.verdict import judge
from outrider.errors import InputError
from outrider.scenarios.options import Options, apply
from outrider.simulation.preparation import Prepared
from outrider.swarm import command as swarm
from tests.outrider.shipped import FIREFLY, scenario

LENGTH = CertifiedConfig().epoch_us
"""Length of an epoch, µs."""


class Ended(NamedTuple):
    status: int
    out: str
    err: str


Replay = Callable[..., Ended]
Change = Callable[[Tunnel], Tunnel | None]


CERTIFIED = Options(avoidance="certified")
PLANAR = CERTIFIED._replace(planar=True)
LOSSY = PLANAR._replace(loss=0.3, delay_ms=60.0)
SLOW = PLANAR._replace(loss=0.6, delay_ms=200.0)


def fly(
    directory: Path,
    vehicles: int,
    *,
    airborne: bool = True,
    seed: int = 1,
    cap_s: float = 5.0,
    options: Options = CERTIFIED,
) -> Path:
    """A swap of places, as the command flies it."""
    directory.mkdir()
    of = scenario(
        "antipodal-8",
        vehicles=vehicles,
        airborne=airborne,
        cap_s=cap_s,
        starts={"radius": 3.0, "jitter": 0.0},
    )
    swarm.fly(Prepared(apply(of, options), FIREFLY), seed, directory, lambda _stage, _seconds: None)
    return directory


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fly(tmp_path_factory.mktemp("flown") / "run", 3)


@pytest.fixture(scope="module")
def thin(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with little but plans in its logs: they can be damaged many times in short time."""
    folder = tmp_path_factory.mktemp("thin") / "run"
    shutil.copytree(flown, folder, ignore=shutil.ignore_patterns("*.png", "*.npz"))
    for log in folder.glob("*.tlog"):
        rewrite(log, lambda tunnel: tunnel, rest=False)
        log.write_bytes(log.read_bytes()[:60_000])
    return folder


@pytest.fixture
def run(flown: Path, tmp_path: Path) -> Path:
    """A copy that may be spoilt."""
    return Path(shutil.copytree(flown, tmp_path / "run"))


@pytest.fixture
def replay(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Replay:
    """The command as a script sees it."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["outrider", "replay", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        assert isinstance(code, int)
        said = Ended(code, *capsys.readouterr())
        assert "Traceback" not in said.err
        return said

    return call


def rewrite(log: Path, change: Change, *, rest: bool = True) -> None:
    """Every TUNNEL of a log as ``change`` has it, None to leave it out, with sound checksums; and the
    ``rest``."""
    records = list(read_tlog(log))
    codec = Codec()
    with TlogWriter(log) as writer:
        for record, message in _messages(records):
            if not isinstance(message, Tunnel):
                if rest:
                    writer.write(record.time | record.link, record.link, record.frame)
                continue
            changed = change(message)
            if changed is not None:
                writer.write(record.time | record.link, record.link, codec.encode(changed))


def _messages(records: list[Record]) -> Iterator[tuple[Record, Message | None]]:
    codec = Codec(lambda identifier, _system, _component: identifier == 385)
    for record in records:
        found = codec.feed(record.frame)
        yield record, found[0] if found else None


def plans_of(system: int) -> Callable[[Tunnel], bool]:
    return lambda tunnel: tunnel.payload_type == PAYLOAD_TYPE and tunnel.source.system == system


def states(system: int) -> Callable[[Tunnel], bool]:
    return lambda tunnel: tunnel.payload_type == AGREEMENTS and tunnel.source.system == system


def test_a_flight_is_certified(flown: Path, replay: Replay) -> None:
    ended = replay(flown, "--certify", "--json")
    assert (ended.status, ended.err) == (0, "")
    assert ended.out.count("\n") == 1
    said = json.loads(ended.out)
    assert said["certified"] is True
    assert said["findings"] == []
    assert said["vehicles"] == 3
    assert said["epochs"] > 20
    assert said["pairs"] == 3 * said["epochs"] - said["unchecked"]["resting"]
    # They have passed each other.
    assert said["required_m"] - 1e-6 <= said["least_m"] < 1.5
    assert said["plans"] > 40
    assert (said["anchors"], said["farewells"], said["damaged_records"]) == (0, 0, 0)


def test_for_people_it_is_a_table(flown: Path, replay: Replay) -> None:
    ended = replay(flown, "--certify")
    assert (ended.status, ended.err) == (0, "")
    for words in ("certified", "pairs of plans checked", "least distance", "carried on", "farewells"):
        assert words in ended.out
    assert "{" not in ended.out


def test_the_line_of_the_verdict_is_whole_for_a_name_of_any_length(
    flown: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdict = judge(read(flown, lambda _what, _share: None))
    for length in range(1, 200):
        show("a" * length, verdict)
        assert capsys.readouterr().out.startswith("a" * length + " · certified\n")


@pytest.mark.slow
def test_who_lands_says_farewell(tmp_path: Path) -> None:
    run = fly(tmp_path / "run", 2, airborne=False)
    said = judge(read(run, lambda _what, _share: None)).document()
    assert said["certified"], said["findings"]
    assert said["farewells"] == 2


@pytest.mark.parametrize("number", [0, 40])
@pytest.mark.parametrize("owner", [11, 12])
def test_one_bit_of_one_plan_is_found(owner: int, number: int, run: Path, replay: Replay) -> None:
    """In the sender's own log or in that of who heard it; checksums hold."""
    seen = 0

    def forge(tunnel: Tunnel) -> Tunnel:
        nonlocal seen
        if not plans_of(11)(tunnel):
            return tunnel
        seen += 1
        if seen != number + 1:
            return tunnel
        payload = bytearray(tunnel.payload)
        # A bit of the first place: the plan looks as sound as before.
        payload[12] ^= 1
        return tunnel._replace(payload=bytes(payload))

    rewrite(run / f"vehicle-{owner}.tlog", forge)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    found = json.loads(ended.out)["findings"]
    assert any("1 bit differs" in one["figures"] and 11 in one["who"] for one in found)
    for one in found:
        assert -1.0 < one["when_s"] < 60.0
    ended = replay(run, "--certify")
    assert ended.status == 1
    assert "not certified" in ended.out
    assert "1 bit differs" in ended.out


def test_a_log_that_is_left_as_it_was_copied_is_certified(run: Path, replay: Replay) -> None:
    """So that what is found in forged logs is what was forged."""
    rewrite(run / "vehicle-11.tlog", lambda tunnel: tunnel)
    assert replay(run, "--certify").status == 0


def test_lost_copies_change_nothing_but_a_lost_plan_is_found(run: Path, replay: Replay) -> None:
    seen: set[bytes] = set()

    def once(tunnel: Tunnel) -> Tunnel | None:
        if not plans_of(11)(tunnel):
            return tunnel
        again = tunnel.payload in seen
        seen.add(tunnel.payload)
        return None if again else tunnel

    rewrite(run / "vehicle-11.tlog", once)
    assert replay(run, "--certify").status == 0
    lost = sorted(seen)[len(seen) // 2]
    rewrite(run / "vehicle-11.tlog", lambda tunnel: None if tunnel.payload == lost else tunnel)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    (finding,) = json.loads(ended.out)["findings"]
    assert finding["who"] == [11, 12, 13]
    assert "did not send" in finding["what"]


def test_what_a_vehicle_has_not_heard_it_cannot_count_on(run: Path, replay: Replay) -> None:
    """The statements of 12 are gone from the log of 11, which made its plans nevertheless."""
    rewrite(run / "vehicle-11.tlog", lambda tunnel: None if states(12)(tunnel) else tunnel)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    found = json.loads(ended.out)["findings"]
    assert {"a plan without an agreement", "an agreement dropped"} == {one["what"] for one in found}
    assert all(one["who"] == [11, 12] for one in found)


def test_a_vehicle_that_states_nothing_is_found(run: Path, replay: Replay) -> None:
    for log in run.glob("*.tlog"):
        rewrite(log, lambda tunnel: None if states(13)(tunnel) else tunnel)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    found = json.loads(ended.out)["findings"]
    assert [13, 11, 12] in [one["who"] for one in found if one["what"] == "a plan without a statement"]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "options"), [(1, PLANAR), (1, LOSSY), (2, LOSSY), (3, SLOW)])
def test_flights_with_loss_and_delay_are_certified(seed: int, options: Options, tmp_path: Path) -> None:
    run = fly(tmp_path / "run", 4, seed=seed, options=options)
    said = judge(read(run, lambda _what, _share: None)).document()
    assert said["findings"] == []
    assert said["agreements"] > 100
    # Each plan keeps at least one agreement with each of the three others.
    assert said["planes_checked"] >= 3 * said["plans"]


# Companions that break a rule

Break = Callable[[pytest.MonkeyPatch], None]


def without_planes(patch: pytest.MonkeyPatch) -> None:
    """Nobody looks at the others' plans."""
    patch.setattr(Agreements, "agreed", lambda self: [])


def without_the_oldest_planes(patch: pytest.MonkeyPatch) -> None:
    """Of several agreements with a peer, plans keep only the newest."""
    agreed = Agreements.agreed

    def newest(self: Agreements) -> list[AgreedPlanes]:
        counts = [len(peer.pair.kept) for _, peer in sorted(self._peers.items())]
        whole = agreed(self)
        return [whole[end - 1] for count, end in zip(counts, accumulate(counts), strict=True) if count]

    patch.setattr(Agreements, "agreed", newest)


def against_stale_plans(patch: pytest.MonkeyPatch) -> None:
    """Planes are computed from a plan of the peer that is two epochs older."""

    def stale(self: Agreements) -> list[AgreedPlanes]:
        negotiation, two = self._negotiation, 2 * self._config.epoch_us
        kept = [(peer, one) for peer in self._peers.values() for one in peer.pair.kept]
        pairs = [(peer, negotiation.plans_of(peer, one)) for peer, one in kept]
        return [
            made(own, peer.plans.get(other.plan.epoch - two) or other, negotiation._geometry.agreed)
            for peer, (own, other) in pairs
        ]

    patch.setattr(Agreements, "agreed", stale)


def without_acknowledgements(patch: pytest.MonkeyPatch) -> None:
    """A newer agreement replaces the older one before the peer has stated it."""

    def succeed(self: Pair) -> None:
        self.kept = self.kept[-1:]

    patch.setattr(Pair, "_succeed", succeed)


def without_agreements(patch: pytest.MonkeyPatch) -> None:
    """Nobody waits for an agreement."""
    patch.setattr(Agreements, "missing", lambda self: set())


def without_refusals(patch: pytest.MonkeyPatch) -> None:
    """What the peer has proposed is taken, whether or not the own plan keeps it."""
    patch.setattr(negotiation, "keeps", lambda *_, **__: True)


def withdrawn_unconsidered(patch: pytest.MonkeyPatch) -> None:
    """An agreement is dropped when a statement of the peer lacks it, considered or not."""
    receive = Pair.receive

    def hasty(self: Pair, epoch: int, since: int, entry: Entry) -> bool:
        stated = {Agreement(own, other) for other, own in entry.agreements}
        self.kept = tuple(one for one in self.kept if one in stated)
        return receive(self, epoch, since, entry)

    patch.setattr(Pair, "receive", hasty)


def taken_again(patch: pytest.MonkeyPatch) -> None:
    """It is forgotten which agreements were considered."""
    patch.setattr(Pair, "newer", lambda self, one, than: one not in self.kept)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("breaks", "whats"),
    [
        (without_planes, {"a plan beyond agreed planes"}),
        (without_the_oldest_planes, {"a plan beyond agreed planes"}),
        (against_stale_plans, {"a plan beyond agreed planes"}),
        (without_refusals, {"a plan beyond agreed planes"}),
        (without_acknowledgements, {"an agreement dropped", "a plan without an agreement"}),
        (withdrawn_unconsidered, {"an agreement dropped"}),
        (without_agreements, {"a plan without an agreement"}),
        (taken_again, {"an agreement taken again"}),
    ],
)
def test_companions_that_break_a_rule_are_found(
    breaks: Break, whats: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within twenty short flights with loss and delay."""
    breaks(monkeypatch)
    for seed in range(1, 21):
        run = fly(tmp_path / str(seed), 3, seed=seed, cap_s=3.0, options=LOSSY if seed % 2 else SLOW)
        verdict = judge(read(run, lambda _what, _share: None))
        if whats & {finding.what for finding in verdict.findings}:
            assert not verdict.certified
            return
    pytest.fail("twenty flights were certified")


@pytest.mark.slow
@pytest.mark.parametrize("waits", [True, False])
def test_a_take_off_and_a_landing_without_waiting_are_found(
    waits: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nobody hears anybody."""
    options = CERTIFIED
    if not waits:
        monkeypatch.setattr(Reservation, "missing", lambda self, now: "")
        options = CERTIFIED._replace(loss=1.0)
    run = fly(tmp_path / "run", 2, airborne=False, cap_s=0.5, options=options)
    verdict = judge(read(run, lambda _what, _share: None))
    found = {finding.what for finding in verdict.findings}
    both = {"a climb without a reservation", "a descent without a reservation"}
    assert found == (set() if waits else both)
    assert verdict.pairs.farewell == 0 or not waits


def test_a_second_take_off_is_judged_also_without_a_landing_between(run: Path) -> None:
    """A pilot has landed the vehicle: it begins anew on the ground. A repeated order is one order."""
    log = run / "vehicle-11.tlog"
    records = list(read_tlog(log))
    last = records[-1].time
    (said, *_) = (
        unpack(message.payload)
        for _, message in reversed(list(_messages(records)))
        if isinstance(message, Tunnel) and message.payload_type == AGREEMENTS and message.source.system == 11
    )
    own = Source(11, COMPONENT)
    climb = CommandLong(own, 11, 1, mavlink.MAV_CMD_NAV_TAKEOFF, 0, (0.0,) * 7)
    anew = said._replace(epoch=said.epoch + LENGTH, since=said.epoch + LENGTH, entries=())
    landed = Tunnel(own, 0, 0, AGREEMENTS, pack(anew))
    codec = Codec()
    with TlogWriter(log) as writer:
        for record in records:
            writer.write(record.time | record.link, record.link, record.frame)
        for k, message in enumerate((climb, climb, landed, climb, climb), 1):
            writer.write(last + 500_000 * k, 0, codec.encode(message))
    verdict = judge(read(run, lambda _what, _share: None))
    climbs = [one for one in verdict.findings if one.what == "a climb without a reservation"]
    assert [one.time - climbs[0].time for one in climbs] == [0, 1_500_000]


def test_who_replans_without_the_other_s_plan_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, replay: Replay
) -> None:
    """Head-on, and nobody waits for anybody's plan or looks at one."""
    without_agreements(monkeypatch)
    without_planes(monkeypatch)
    run = fly(tmp_path / "run", 2)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    said = json.loads(ended.out)
    assert said["certified"] is False
    assert said["least_m"] < 0.5 < said["required_m"]
    near = [one for one in said["findings"] if one["what"] == "plans nearer than certified"]
    assert [one["who"] for one in near] == [[11, 12]]


# Bad input


def refused(ended: Ended, *words: str) -> None:
    assert ended.status == 2
    assert ended.out == ""
    assert ended.err.count("\n") == 1
    for word in (*words, "allowed"):
        assert word in ended.err


def test_what_is_no_run(tmp_path: Path, flown: Path, run: Path, replay: Replay) -> None:
    refused(replay(tmp_path / "nowhere", "--certify"), "nowhere", "no such directory")
    refused(replay(flown / "configuration.yaml", "--certify"), "configuration.yaml", "not a directory")
    for log in run.glob("*.tlog"):
        log.unlink()
    refused(replay(run, "--certify"), str(run), "vehicle-N.tlog")
    (run / "configuration.yaml").unlink()
    ended = replay(run, "--certify")
    assert (ended.status, ended.err.count("\n")) == (2, 1)
    assert "configuration.yaml: no such file" in ended.err


def test_a_flight_of_the_field_has_nothing_to_certify(run: Path, replay: Replay) -> None:
    path = run / "configuration.yaml"
    text = path.read_text()
    path.write_text(text.replace("avoidance: certified", "avoidance: field"))
    refused(replay(run, "--certify"), "'field'", "--avoidance certified")
    path.write_text(text)
    for log in run.glob("*.tlog"):
        rewrite(log, lambda tunnel: None)
    refused(replay(run, "--certify"), "no plan", "--avoidance certified")


def test_logs_of_garbage_are_refused_and_one_of_them_is_named(run: Path, replay: Replay) -> None:
    logs = sorted(run.glob("*.tlog"))
    logs[0].write_bytes(b"\0\1\2\3" * 1000)
    ended = replay(run, "--certify", "--json")
    assert ended.status == 1
    (finding,) = json.loads(ended.out)["findings"]
    assert (finding["who"], finding["when_s"]) == ([11], 0.0)
    assert "no log" in finding["what"]
    for log in logs:
        log.write_bytes(b"\0\1\2\3" * 1000)
    refused(replay(run, "--certify"), "vehicle-11.tlog", "no MAVLink")


def test_damaged_records_are_counted(run: Path, replay: Replay) -> None:
    log = run / "vehicle-12.tlog"
    data = bytearray(log.read_bytes())
    for at in range(5_000, 105_000, 10_000):
        data[at] ^= 0xFF
    log.write_bytes(bytes(data))
    ended = replay(run, "--certify", "--json")
    assert ended.status in (0, 1)
    assert json.loads(ended.out)["damaged_records"] >= 5


@settings(max_examples=30)
@given(
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.binary(max_size=40)), max_size=12),
    st.floats(0.0, 1.0),
    st.sampled_from([11, 12, 13]),
)
def test_whatever_becomes_of_a_log_it_ends_with_a_verdict_or_is_refused(
    thin: Path, edits: list[tuple[float, bytes]], kept: float, system: int
) -> None:
    log = thin / f"vehicle-{system}.tlog"
    whole = log.read_bytes()
    data = bytearray(whole[: round(kept * len(whole))] if kept < 0.7 else whole)
    for at, junk in edits:
        place = int(at * len(data))
        data[place : place + len(junk)] = junk
    log.write_bytes(bytes(data))
    try:
        said = json.dumps(judge(read(thin, lambda _what, _share: None)).document())
        assert "NaN" not in said
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    finally:
        log.write_bytes(whole)
