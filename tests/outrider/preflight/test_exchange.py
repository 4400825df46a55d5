"""Reports in parts: whole again in any order, and complete only with all parts of one process."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from mavlink_bridge.wire.preflight import LINKS_PER_PART, LinkReport, Probe, Report, pack, unpack
from outrider.preflight.exchange import Exchange, in_parts, whole
from outrider.preflight.link_meter import LinkMeter

FLEET = 0xABCDEF
REPORT = Report(5, FLEET, True, (False,) * 3, 0, 1, 3, 1_700_000_000, (400, 1_000, None), ())


def links(count: int) -> list[LinkReport]:
    return [LinkReport(1 + k, 10 * k, k, None if k % 2 else k) for k in range(count)]


def exchange() -> Exchange:
    """One other vehicle, 2, of which a probe was received."""
    meter = LinkMeter(25_000)
    meter.receive(0, Probe(5, FLEET, 0, 0))
    return Exchange({2: meter}, FLEET)


@given(st.integers(1, 200), st.randoms(use_true_random=False), st.booleans())
def test_a_report_of_any_fleet_is_whole_again_in_any_order(count: int, random: object, twice: bool) -> None:
    parts = in_parts(REPORT, links(count))
    assert len(parts) == -(-count // LINKS_PER_PART)
    sent = [unpack(pack(part)) for part in parts] * (1 + twice)
    random.shuffle(sent)  # type: ignore[attr-defined]
    one = exchange()
    for number, part in enumerate(sent):
        assert isinstance(part, Report)
        assert bool(one.reports()) == (len({seen.part for seen in sent[:number]}) == len(parts))  # type: ignore[union-attr]
        one.receive(2, part)
    assert not one.awaited()
    assert one.reports()[2].links == tuple(links(count))
    assert whole(parts).links == tuple(links(count))


def test_parts_of_two_processes_do_not_make_a_report() -> None:
    first, second = in_parts(REPORT, links(2 * LINKS_PER_PART))
    one = exchange()
    one.receive(2, first._replace(run=4))
    one.receive(2, second)
    assert one.awaited() == {2: "no report: its own screen says what it waits for"}
    one.receive(2, first)
    assert one.reports()[2] == whole([first, second])


def test_a_report_of_another_fleet_is_ignored() -> None:
    one = exchange()
    one.receive(2, REPORT._replace(fingerprint=FLEET + 1, links=(LinkReport(1, 0, 0, 0),)))
    assert list(one.awaited()) == [2]
