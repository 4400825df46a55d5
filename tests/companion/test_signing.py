"""A companion with a key hears who has it, and is heard; otherwise nothing is different."""

from __future__ import annotations

import pytest

from companion.values.phase import Phase
from mavlink_bridge.key import Key
from mavlink_bridge.messages import Heartbeat
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import Signing
from tests.companion.bench import LINKS, TARGET, Bench, seen_at

KEY, OTHER = Key.of_passphrase("correct horse"), Key.of_passphrase("battery staple")


def test_with_one_key_everywhere_a_flight_is_the_same_as_without():
    plain, signed = Bench(), Bench(key=KEY, others=KEY)
    for bench in (plain, signed):
        bench.target = seen_at(TARGET, [4.0, 0.0, 0.0])
        bench.take_off(5.0)
        bench.fly(0.5)
    assert repr(signed.sent) == repr(plain.sent)  # a NaN is not itself


@pytest.mark.parametrize("others", [None, OTHER])
def test_who_has_not_the_key_is_not_heard_on_any_link(others):
    bench = Bench(key=KEY, others=others)
    bench.fly(2.0)
    assert bench.phase is Phase.CONNECT
    assert bench.order(22, 0, 0, 0, 0, 0, 0, 5.0) == []
    for link in LINKS:
        bench.step(bench.datagram(link, seen_at(TARGET, [4.0, 0.0, 0.0])))
    assert bench.companion.world.at(bench.now).target is None


def test_each_link_has_a_number_of_its_own():
    bench = Bench(key=KEY, others=KEY)
    found = {}
    codec = Codec(None, Signing(KEY))
    for link, data in bench.companion.step(bench.now, []):
        assert any(isinstance(message, Heartbeat) for message in codec.feed(data))
        found[link] = data[-13]
    assert found == {link: LINKS.index(link) for link in ("autopilot", "swarm")}
