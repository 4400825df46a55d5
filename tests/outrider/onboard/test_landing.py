"""A return is a success only where the vehicle was measured to be at its place."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.landing import Landing
from outrider.onboard.event_log import EventLog
from outrider.onboard.figures import summary
from outrider.onboard.flight import Flight
from outrider.onboard.landing import verdict
from outrider.onboard.request import Request
from outrider.scenarios.fly_config import FleetOrigin, FlyConfig

CONFIG = FlyConfig(system=1, target=100, origin=FleetOrigin(latitude=47.4, longitude=8.5, altitude=488.0))


@given(off=st.none() | st.floats(0.0, 1e4))
def test_only_who_is_measured_to_be_there_has_returned(off):
    assert verdict(off, returning=False) == ("landed", False)
    text, fault = verdict(off, returning=True)
    assert (text == "landed") == (off is not None and off <= 1.5)
    assert fault == (off is None or off > 6.0)
    if off is not None and off > 1.5:
        assert str(round(off)) in text or f"{off:.1f}" in text


class Said:
    """The end of what joins two processes at which news arrive."""

    def __init__(self, *news):
        self._news = list(news)

    def news(self):
        news, self._news = self._news, []
        return [dict(one) for one in news]

    def beat(self, now):
        """Nothing is done with it."""

    def fileno(self):
        return -1


@pytest.mark.parametrize(
    ("landing", "ended", "fault"),
    [
        ({"returning": True, "off": 0.4}, "landed", False),
        ({"returning": True, "off": 3.2}, "landed, 3.2 m beside its place", False),
        ({"returning": True, "off": 17.3}, "landed on its way back, 17 m from its place", True),
        ({"returning": True, "off": None}, "landed on its way back, where is not known", True),
        ({"returning": False, "off": 17.3}, "landed", False),
    ],
)
def test_what_the_process_that_flew_measured_is_what_is_reported(
    landing, ended, fault, tmp_path, monkeypatch
):
    class Companions:
        status, sentinel = None, -1

    def at_once(_ends, _timeout):
        return []

    monkeypatch.setattr("outrider.onboard.flight.wait", at_once)
    said = Said({"kind": "landing", **landing}, {"kind": "event", "what": "phase", "text": "done", "at": 1.0})
    event_log = EventLog(tmp_path, lambda: 0.0)
    typed = type("Typed", (), {"lines": lambda self: []})()
    flight = Flight(Request(CONFIG, "px4", {}), None, tmp_path, event_log, typed, (), lambda: None)
    flight._look_after(said, Companions())
    assert flight._over()
    assert (flight.ended, flight._elsewhere) == (ended, fault)
    assert flight.landing == Landing(**landing)
    told = summary(flight, tmp_path)
    assert (told["ended"], told["landed_off_m"]) == (ended, landing["off"])
    event_log.close()
