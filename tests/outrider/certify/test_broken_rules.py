"""Companions that break a rule of certified separation are found."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import accumulate
from math import sqrt
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as mavlink

from companion.avoidance.certified import departed, negotiation
from companion.avoidance.certified.agreed_planes import AgreedPlanes, made
from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.margins import between
from companion.avoidance.certified.pair import Agreement, Pair
from companion.avoidance.certified.reservation import Reservation
from companion.config.certified import CertifiedConfig
from companion.config.planning import FieldConfig, LimitsConfig
from companion.values.components import COMPONENT
from mavlink_bridge.messages import CommandLong, Source, Tunnel
from mavlink_bridge.tlog.log import TlogWriter, read_tlog
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, pack, unpack
from mavlink_bridge.wire.codec import Codec
from outrider.certify.reading import read
from outrider.certify.verdict import judge
from tests.outrider.certify.runs import CERTIFIED, LOSSY, PLANAR, SLOW, Replay, fly, tunnels

LENGTH = CertifiedConfig().epoch_us
"""Length of an epoch, µs."""


Break = Callable[[pytest.MonkeyPatch], None]


def without_planes(patch: pytest.MonkeyPatch) -> None:
    """Nobody looks at the others' plans."""
    patch.setattr(Agreements, "agreed", lambda self: [])


def without_the_oldest_planes(patch: pytest.MonkeyPatch) -> None:
    """Of several agreements with a peer, plans keep only the newest."""
    agreed = Agreements.agreed

    def newest(self: Agreements) -> list[AgreedPlanes]:
        counts = [len(peer.pair.kept) for _, peer in sorted(self.peers.counted.items())]
        whole = agreed(self)
        return [whole[end - 1] for count, end in zip(counts, accumulate(counts), strict=True) if count]

    patch.setattr(Agreements, "agreed", newest)


def against_stale_plans(patch: pytest.MonkeyPatch) -> None:
    """Planes are computed from a plan of the peer that is two epochs older."""

    def stale(self: Agreements) -> list[AgreedPlanes]:
        negotiation, two = self.negotiation, 2 * self._config.epoch_us
        kept = [(peer, one) for peer in self.peers.counted.values() for one in peer.pair.kept]
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


def errors_of_one_side(patch: pytest.MonkeyPatch) -> None:
    """Plans keep √2·k·σ in place of 2·k·σ, as if errors were independent and not opposite."""

    def independent(certified: CertifiedConfig, field: FieldConfig, limits: LimitsConfig) -> float:
        surplus = (2.0 - sqrt(2.0)) * certified.sigmas * field.position_sigma
        return between(certified, field, limits) - surplus

    patch.setattr(departed, "between", independent)


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
def test_a_distance_for_independent_errors_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    errors_of_one_side(monkeypatch)
    run = fly(tmp_path / "run", 3, options=PLANAR._replace(sensors="gnss"))
    verdict = judge(read(run, lambda _what, _share: None))
    assert "plans nearer than certified" in {finding.what for finding in verdict.findings}


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
        for _, message in reversed(list(tunnels(records)))
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
