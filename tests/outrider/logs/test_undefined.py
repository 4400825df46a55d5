"""A message that the bridge has and the dialect lacks."""

from __future__ import annotations

from pathlib import Path

from mavlink_bridge.messages import ComponentMetadata, Heartbeat, Source
from mavlink_bridge.tlog.log import TlogWriter
from mavlink_bridge.wire.codec import Codec
from outrider.logs.message_stream import Log
from outrider.logs.tally import count
from outrider.logs.words import rates

NOW = 1_700_000_000_000_000


def test_it_is_named_in_a_list_and_counted_as_unknown_in_an_export(tmp_path: Path) -> None:
    codec, path = Codec(), tmp_path / "flight.tlog"
    sent = Heartbeat(Source(1, 1), 2, 12, 0, 0, 4), ComponentMetadata(Source(1, 1), 0, 7, "mftp://x")
    with TlogWriter(path) as log:
        for at, message in enumerate(sent):
            log.write(NOW + at * 1_000_000, 0, codec.encode(message))
    census = count(path, lambda _share: None)
    assert census is not None
    (vehicle,) = census.vehicles
    assert set(rates(vehicle)) == {"HEARTBEAT", "COMPONENT_METADATA"}
    messages = Log(path, None)
    assert len(list(messages)) == 1
    assert messages.loss.unknown == 1
