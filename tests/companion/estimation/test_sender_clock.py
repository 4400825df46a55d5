"""Clocks of senders: jitter does not date a measurement; drift, steps and reboots are followed, and stamps of
no use are seen through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import outrider
from companion.config.estimation import TrackConfig
from companion.estimation.sender_clock import SenderClock
from companion.estimation.tracks import Track
from mavlink_bridge.frames import FleetFrame, ned_to_enu
from mavlink_bridge.messages import GlobalPosition
from mavlink_bridge.tlog.log import read_tlog
from mavlink_bridge.wire.codec import Codec
from tests.companion.rig import LAWS, QUICK, numbers

DELAY, LATEST = 20_000, 2_000_000
NOW = 1_767_225_600_000_000
SECOND = 1_000_000
LOG = Path(outrider.__file__).parents[2] / "config" / "logs" / "escort-target.tlog"


def dated(clock, sent, lateness, offset=NOW, rate=1.0):
    """When the clock says that messages sent at ``sent`` (µs of ours) were true, on our time; None where it
    does not say. Their stamps are whole milliseconds of a clock that runs at ``rate``."""
    said = [None] * len(sent)
    for k in sorted(range(len(sent)), key=lambda k: (sent[k] + lateness[k], k)):
        stamp = SECOND + int(sent[k] * rate) // 1000 * 1000
        date = clock.date(offset + sent[k] + DELAY + lateness[k], stamp)
        said[k] = None if date is None else date.time + clock.skew - offset
    return said


@LAWS
@given(
    seed=st.integers(0, 2**32 - 1),
    jitter=st.integers(0, 300_000),
    period=st.integers(20, 500),
    boot=st.integers(1, 10**12),
)
def test_jitter_does_not_date_a_measurement(seed, jitter, period, boot):
    """Once one of them was quick: the distances in time are exact, and the offset is the least lag."""
    random = np.random.default_rng(seed)
    clock = SenderClock(DELAY, LATEST)
    lags, times = [], []
    for k in range(50):
        true = k * period * 1000
        late = 0 if k == 0 else int(random.integers(0, jitter + 1))
        lags.append(late)
        date = clock.date(NOW + true + DELAY + late, boot + true)
        assert date.stamped
        times.append(date.time)
        # The line lies still for five seconds.
        if period * k < 4000:
            assert date.time + clock.skew == NOW + true
    assert np.diff(times).tolist() == [period * 1000] * 49


@QUICK
@given(
    seed=st.integers(0, 2**32 - 1),
    ppm=numbers(-200.0, 200.0),
    jitter=st.sampled_from([0, 10_000, 100_000]),
    rate=st.sampled_from([5, 10, 50]),
)
def test_drift_is_followed_to_the_end_of_the_jitter(seed, ppm, jitter, rate):
    """What is left is the grain of a millisecond, and what the quickest messages leave of their jitter."""
    random = np.random.default_rng(seed)
    clock = SenderClock(DELAY, LATEST)
    hour = 3600 * SECOND
    sent = hour + np.arange(400) * (SECOND // rate)
    dated(clock, [0, SECOND // rate], [0, 0], rate=1.0 + 1e-6 * ppm)
    lateness = random.integers(0, jitter + 1, len(sent))
    said = dated(clock, sent.tolist(), lateness.tolist(), rate=1.0 + 1e-6 * ppm)
    off = np.abs(np.array(said[len(said) // 2 :]) - sent[len(said) // 2 :])
    assert off.max() <= 1500 + 0.5 * jitter
    assert off.mean() <= 1500 + 0.1 * jitter


@pytest.mark.parametrize("rate", [0.5, 0.8, 0.989, 1.01, 2.0, 5.0])
def test_a_simulator_that_is_slower_or_faster_than_time_is_followed(rate):
    """10 Hz of ours. A clock that creeps is late at first, until half a minute has told its rate; it is never
    early, nor is a fast one."""
    clock = SenderClock(DELAY, LATEST)
    sent = np.arange(0, 120 * SECOND, 100_000)
    said = dated(clock, sent.tolist(), [0] * len(sent), rate=rate)
    off = np.array([0 if s is None else s - true for s, true in zip(said, sent, strict=True)])
    assert sum(s is None for s in said) < 12
    assert np.abs(off[400:]).max() <= 30_000
    assert off.max() <= 2000


def ages_after(clock, lateness, period=20_000, first=5 * SECOND):
    """How old the clock says that messages are at their arrival, and how old they are, when the link holds
    each back by what ``lateness`` says (µs), after ``first`` µs without."""
    quick = first // period
    said, true = [], []
    for k in range(quick + len(lateness)):
        late = DELAY + (lateness[k - quick] if k >= quick else 0)
        sent = k * period
        date = clock.date(NOW + sent + late, 10 * SECOND + sent)
        if date is None:
            continue
        said.append(NOW + sent + late - date.time - clock.skew)
        true.append(late)
    return np.array(said), np.array(true)


DRIFT = 200e-6


@pytest.mark.parametrize("delay", [0.05, 0.3, 0.39])
@pytest.mark.parametrize("rate", [50, 10, 5])
def test_a_link_that_becomes_slow_is_seen_to_be_slow_for_ever(delay, rate):
    """Five minutes: only what two quartzes may drift apart is forgiven."""
    period = SECOND // rate
    clock = SenderClock(DELAY, LATEST)
    said, true = ages_after(clock, [round(delay * 1e6)] * (300 * rate), period)
    assert len(said) == 305 * rate
    assert (said <= true).all()
    assert (true - said).max() <= DRIFT * 306e6


@QUICK
@given(
    seed=st.integers(0, 2**32 - 1),
    steps=st.lists(st.integers(0, 900_000), min_size=1, max_size=12),
    jitter=st.sampled_from([0, 20_000, 200_000]),
)
def test_a_delay_whatever_it_does_within_a_minute_is_never_understated_by_more_than_drift(
    seed, steps, jitter
):
    """Up and down in steps over fifty-five seconds."""
    random = np.random.default_rng(seed)
    lateness = np.repeat(steps, 550 // len(steps)) + random.integers(
        0, jitter + 1, 550 // len(steps) * len(steps)
    )
    rises = np.diff([0, *steps])
    clock = SenderClock(DELAY, LATEST)
    said, true = ages_after(clock, lateness.tolist(), 100_000)
    if np.count_nonzero(rises > 0) <= 3:
        assert (true - said).max() <= DRIFT * 63e6
    # Four and more at equal distances in half a minute could be a slow clock's.
    assert (said <= true).all()


@LAWS
@given(first=st.integers(0, 390_000), more=st.integers(0, 5 * SECOND), rate=st.sampled_from([10, 50]))
def test_a_delay_that_grows_never_lowers_the_age(first, more, rate):
    """Two links, one of which becomes slower than the other: it is never believed to be fresher."""
    period = SECOND // rate
    one, _ = ages_after(SenderClock(DELAY, LATEST), [first] * (40 * rate), period)
    other, true = ages_after(SenderClock(DELAY, LATEST), [first + more] * (40 * rate), period)
    assert (other >= one - DRIFT * more - 1).all()
    assert other[-1] >= true[-1] - DRIFT * 51e6
    # Nor does it become younger with time.
    assert np.diff(other[5 * rate :]).min() >= -DRIFT * period - 1


@pytest.mark.parametrize("delay", [0.45, 0.9, 3.0])
def test_what_would_be_of_no_use_for_ever_is_taken_for_a_clock_that_stood_after_a_minute(delay):
    """A simulator that hung must not ground a vehicle; not before a minute of nothing better."""
    late = round(delay * 1e6)
    said, _ = ages_after(SenderClock(DELAY, LATEST), [late] * (100 * 50))
    slow = said[5 * 50 :]
    assert (slow[: 59 * 50] >= DELAY + late * 0.9).all()
    assert (slow[71 * 50 :] <= DELAY + DRIFT * 130e6).all()


@LAWS
@given(
    frozen=st.integers(2, 20),
    rate=st.sampled_from([10, 50]),
    at_once=st.booleans(),
    before=st.integers(3, 20),
)
def test_what_waited_while_the_companion_hung_is_as_old_as_it_is(frozen, rate, at_once, before):
    """It comes in one burst, or as fast as a link lets it through: its stamps advance, not its arrivals."""
    period = SECOND // rate
    clock = SenderClock(DELAY, LATEST)
    for k in range(before * rate):
        clock.date(NOW + k * period + DELAY, 10 * SECOND + k * period)
    thaw = (before + frozen) * SECOND
    for i in range(frozen * rate):
        sent = before * SECOND + i * period
        received = thaw if at_once else thaw + i * period // 10
        received = max(received, sent + DELAY)
        date = clock.date(NOW + received, 10 * SECOND + sent)
        assert date.stamped
        age = NOW + received - date.time - clock.skew
        assert age == pytest.approx(received - sent, abs=DRIFT * 45e6)
        assert age <= received - sent


def test_an_echo_of_long_ago_is_no_clock_that_began_anew():
    """A second way with three seconds of delay, heard in a burst when the first falls silent."""
    clock = SenderClock(DELAY, LATEST)
    for k in range(500):
        clock.date(NOW + k * 20_000 + DELAY, 10 * SECOND + k * 20_000)
    for k in range(100):
        assert clock.date(NOW + 10 * SECOND + DELAY, 5 * SECOND + k * 20_000) is None


@LAWS
@given(quicker=st.integers(0, 1_900_000), rate=st.sampled_from([5, 50]))
def test_a_smaller_delay_is_believed_at_once(quicker, rate):
    """The first ones were slow; one that is not tells how old they were."""
    period = SECOND // rate
    clock = SenderClock(DELAY, LATEST)
    for k in range(20):
        clock.date(NOW + k * period + DELAY + quicker, SECOND + k * period)
    sent = 20 * period
    date = clock.date(NOW + sent + DELAY, SECOND + sent)
    assert date.time + clock.skew == NOW + sent


@LAWS
@given(stamp=st.integers(-1, 10**10), late=st.integers(0, SECOND))
def test_other_messages_are_read_by_the_same_clock_and_teach_it_nothing(stamp, late):
    clock = SenderClock(DELAY, LATEST)
    assert clock.reads(NOW, stamp) == NOW - DELAY
    for k in range(20):
        clock.date(NOW + k * 20_000 + DELAY, SECOND + k * 20_000)
    skew = clock.skew
    sent = 19 * 20_000
    assert clock.reads(NOW + sent + DELAY + late, SECOND + sent) == NOW + sent
    # None is from the future, and one without a stamp is dated by its arrival.
    assert clock.reads(NOW + sent + late, stamp) <= NOW + sent + late - DELAY
    assert clock.reads(NOW + sent + late, 0) == NOW + sent + late - DELAY
    assert (clock.skew, clock.support) == (skew, 20)


@LAWS
@given(step=st.one_of(st.integers(3 * SECOND, 10**13), st.integers(-(10**10), -4 * SECOND)))
def test_a_clock_that_was_set_or_began_anew_is_soon_followed(step):
    """Reboot, or the wrap of the 32-bit milliseconds after 49.7 days: our time goes on. Forward three
    witnesses tell of it; back, a second of them, for old messages may have waited somewhere."""
    clock = SenderClock(DELAY, LATEST)
    uptime = 2 * 10**10
    last = None
    lost = range(20, 22) if step > 0 else range(20, 30)
    for k in range(60):
        true = k * 100_000
        stamp = uptime + true + (step if k >= 20 else 0)
        # The first is slow: what it says of the offset is made good before the step, and not undone by it.
        date = clock.date(NOW + true + DELAY + (50_000 if k == 0 else 0), stamp)
        if k in lost:
            assert date is None
            continue
        if k == 0:
            continue
        assert date.time + clock.skew == NOW + true
        assert last is None or date.time > last
        last = date.time


@QUICK
@given(wild=st.integers(1, 2**32 * 1000) | st.integers(10**8, 10**8 + 30 * 10**5), when=st.integers(5, 30))
def test_one_wild_stamp_makes_nothing_younger(wild, when):
    """One that is out by more than any delay is not believed; one ahead by less makes the others older."""
    clock = SenderClock(DELAY, LATEST)
    for k in range(200):
        true = k * 100_000
        if k == when:
            clock.date(NOW + true + DELAY, wild)
            continue
        date = clock.date(NOW + true + DELAY, 10**8 + true)
        assert date is not None
        assert -LATEST <= date.time + clock.skew - NOW - true <= 0
        if abs(wild - 10**8 - when * 100_000) > LATEST:
            assert date.time + clock.skew == NOW + true


@pytest.mark.parametrize("stamp", [0, -1, 777_000])
def test_stamps_that_do_not_advance_are_of_no_use_and_the_arrival_counts(stamp):
    clock = SenderClock(DELAY, LATEST)
    for k in range(60):
        received = NOW + k * 100_000
        date = clock.date(received, stamp)
        if k > 11 or stamp <= 0:
            assert not date.stamped
            assert date.time + clock.skew == received - DELAY


@QUICK
@given(stamps=st.lists(st.integers(1, 2**32 * 1000), min_size=60, max_size=60))
def test_stamps_all_over_the_place_are_of_no_use_either(stamps):
    clock = SenderClock(DELAY, LATEST)
    for k, stamp in enumerate(stamps):
        received = NOW + k * 100_000
        date = clock.date(received, stamp)
        if date is not None and not date.stamped:
            assert date.time + clock.skew == received - DELAY
    # Not one clock of three in a row agrees: the last ones are dated by their arrival.
    lags = [NOW + k * 100_000 - stamp for k, stamp in enumerate(stamps)]
    if all(max(lags[k : k + 3]) - min(lags[k : k + 3]) > LATEST for k in range(58)):
        assert date is not None
        assert not date.stamped


def test_stamps_that_come_to_their_senses_are_used_again():
    clock = SenderClock(DELAY, LATEST)
    for k in range(20):
        clock.date(NOW + k * 100_000, 777_000)
    dates = [clock.date(NOW + k * 100_000, 888_000 + k * 100_000) for k in range(20, 40)]
    assert [date.stamped for date in dates] == [*[False] * 10, *[True] * 10]
    assert np.diff([date.time for date in dates]).tolist() == [100_000] * 19


def test_two_clocks_under_one_name_do_not_take_turns():
    """An autopilot and its companion both tell of the vehicle: the first is believed, the other is not, and
    takes over when the first falls silent."""
    clock = SenderClock(DELAY, LATEST)
    for k in range(50):
        first = clock.date(NOW + k * 100_000, 10**9 + k * 100_000)
        other = clock.date(NOW + k * 100_000 + 3000, 10**7 + k * 100_000)
        assert first.time + clock.skew == NOW + k * 100_000 - DELAY
        assert other is None
    dates = [clock.date(NOW + k * 100_000, 10**7 + k * 100_000) for k in range(50, 70)]
    assert [date is None for date in dates] == [*[True] * 10, *[False] * 10]


def test_a_burst_at_one_time_is_no_rate():
    """After a stall all that waited arrives at once: many lags, one time."""
    clock = SenderClock(DELAY, LATEST)
    for burst in range(20):
        received = NOW + burst * 2 * SECOND
        for k in range(40):
            date = clock.date(received, 10**9 + burst * 2 * SECOND + k * 25_000)
            assert date.stamped
        assert date.time + clock.skew == received - DELAY


@LAWS
@given(
    messages=st.lists(
        st.tuples(
            st.sampled_from([0, 0, 100_000, 10**8]) | st.integers(-(10**7), 10**8),
            st.integers(-(2**40), 2**43),
        ),
        min_size=1,
        max_size=80,
    ),
    latest=st.integers(0, 10**7),
)
def test_no_times_whatever_raise(messages, latest):
    clock = SenderClock(DELAY, latest)
    now = NOW
    for step, stamp in messages:
        now += step
        date = clock.date(now, stamp)
        if date is not None and not date.stamped:
            assert date.time + clock.skew == now - DELAY


def flown():
    """The shipped log: arrivals, stamps, positions and velocities of a quadrotor that really flew, over a
    radio."""
    codec, rows = Codec(), []
    fleet = FleetFrame(-35.3622913, 149.1656747, 590.74)
    for record in read_tlog(LOG):
        for message in codec.feed(record.frame):
            if isinstance(message, GlobalPosition):
                x = fleet.to_enu(message.latitude, message.longitude, message.altitude)
                rows.append((record.time, message.time_boot, x, ned_to_enu(message.velocity_ned)))
    return rows


def test_a_real_radio_holds_messages_back_and_they_are_dated_nevertheless():
    """Stamps advance by 200 or 400 ms, arrivals by 250 to 670: the lags spread over almost a second, yet
    nothing is refused, no time is out of order, and what is left of the lag is never negative."""
    rows = flown()
    lags = np.array([arrival - stamp for arrival, stamp, _, _ in rows])
    assert np.ptp(lags) > 900_000
    clock = SenderClock(DELAY, LATEST)
    times = []
    for arrival, stamp, _, _ in rows:
        date = clock.date(arrival, stamp)
        assert date.stamped
        assert date.time + clock.skew <= arrival - DELAY + 1
        times.append(date.time)
    assert np.diff(times).tolist() == np.diff([stamp for _, stamp, _, _ in rows]).tolist()


@pytest.mark.parametrize("mangled", ["back", "zero", "standing", "twice", "shuffled"])
def test_a_real_flight_with_spoilt_stamps_is_still_tracked(mangled):
    """What other real logs show: a clock that steps back by minutes, none at all, one that stands; and what
    links do: duplicates, and messages that overtake each other."""
    rows = [[*row] for row in flown()]
    for k, row in enumerate(rows):
        if mangled == "back" and k >= 100:
            row[1] -= 260 * SECOND
        elif mangled == "zero":
            row[1] = 0
        elif mangled == "standing" and k >= 100:
            row[1] = rows[99][1]
    if mangled == "twice":
        rows = [row for row in rows for _ in (0, 1)]
    elif mangled == "shuffled":
        arrivals = [row[0] for row in rows]
        rows[0:200:2], rows[1:200:2] = rows[1:200:2], rows[0:200:2]
        rows = [[arrival, *row[1:]] for arrival, row in zip(arrivals, rows, strict=True)]
    config = TrackConfig(
        sigma_position=0.1, sigma_velocity=0.2, sigma_acceleration=5.0, jump=8.0, velocity_up=True
    )
    track = Track(config)
    worst = 0
    for arrival, stamp, x, v in rows:
        track.measure(arrival, x, v, stamp)
        state = track.at(arrival)
        worst = max(worst, state.age)
        assert np.linalg.norm(state.position - x) < 8.0
    # Two or three messages are not believed when the clock steps, and the radio holds some for a second.
    assert worst < 3 * SECOND
    assert track.rejected <= 6
