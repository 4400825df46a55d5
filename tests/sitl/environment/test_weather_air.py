"""The air: gusts by their formula, Dryden turbulence by its spectrum, still air exactly still."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sitl.environment.turbulence import PERIOD, W20, Turbulence, scales
from sitl.environment.weather import Gust, Weather, WeatherConfig

FOOT = 0.3048
TIMES = st.integers(0, 200_000_000)


def test_as_it_stands_the_air_stands_still():
    weather = Weather(WeatherConfig(), 1, 11)
    weather.begin(0)
    assert WeatherConfig().still
    assert weather.still
    assert not weather.turbulent
    assert all(weather.wind(now, 5.0, (1.0, 2.0, 3.0)) == (0.0, 0.0, 0.0) for now in range(0, 100_000, 5_000))


@pytest.mark.parametrize(
    "config",
    [
        {"wind": (0.0, 0.0, 0.1)},
        {"turbulence": "light"},
        {"turbulence": 0.5},
        {"gusts": [{"at_s": 1.0, "length_s": 1.0, "velocity": (1.0, 0.0, 0.0)}]},
    ],
)
def test_anything_else_is_not_still(config):
    assert not Weather(WeatherConfig(**config), 1, 11).still


@pytest.mark.parametrize(
    "bad",
    [
        {"wind": (51.0, 0.0, 0.0)},
        {"wind": (0.0, 0.0)},
        {"turbulence": "heavy"},
        {"turbulence": -1.0},
        {"gusts": [{"at_s": 1.0, "length_s": 0.0, "velocity": (1.0, 0.0, 0.0)}]},
        {"winds": (0.0, 0.0, 0.0)},
    ],
)
def test_what_is_no_weather_is_refused(bad):
    with pytest.raises(ValidationError):
        WeatherConfig(**bad)


@given(now=TIMES)
def test_the_mean_wind_blows_where_it_says(now):
    """East, north, up in; north, east, down out."""
    assert Weather(WeatherConfig(wind=(3.0, -2.0, 0.5)), 1, 11).wind(now) == (-2.0, 3.0, -0.5)


# Gusts

GUST = Gust(at_s=2.0, length_s=4.0, velocity=(3.0, 5.0, -1.0))


@given(time=st.floats(-10.0, 20.0))
def test_a_gust_is_one_minus_cosine_up_and_down(time):
    share = GUST.share(time)
    assert 0.0 <= share <= 1.0
    assert share == pytest.approx(GUST.share(8.0 - time), abs=1e-9)
    if not 2.0 < time < 6.0:
        assert share == 0.0
    elif time <= 4.0:
        # MIL-F-8785C: half of 1 − cos(π x/d) over the distance d = 2 s in which it builds up.
        assert share == pytest.approx(0.5 * (1.0 - math.cos(math.pi * (time - 2.0) / 2.0)))
    assert GUST.share(4.0) == 1.0


def test_gusts_count_from_the_goal_event_and_add_up():
    gusts = (GUST, Gust(at_s=3.0, length_s=2.0, velocity=(0.0, 0.0, 2.0)))
    weather = Weather(WeatherConfig(wind=(1.0, 0.0, 0.0), gusts=gusts), 1, 11)
    assert weather.wind(4_000_000) == (0.0, 1.0, 0.0)
    weather.begin(5_000_000)
    assert weather.wind(6_900_000) == (0.0, 1.0, 0.0)
    assert weather.wind(9_000_000) == (5.0, 4.0, 1.0 - 2.0)
    assert weather.wind(11_000_000) == (0.0, 1.0, 0.0)


# Turbulence


def test_the_scales_meet_those_of_medium_altitude_at_a_thousand_feet():
    """Where the low-altitude model ends, it is isotropic: L = 1000 ft, and one σ for all."""
    size = scales(1000.0 * FOOT, 10.0)
    assert size.horizontal_length == pytest.approx(1000.0 * FOOT)
    assert size.vertical_length == pytest.approx(1000.0 * FOOT)
    assert size.horizontal == pytest.approx(size.vertical)
    assert size.vertical == 1.0
    assert scales(5000.0, 10.0) == size
    assert scales(0.0, 10.0) == scales(10.0 * FOOT, 10.0)


def test_the_scales_near_the_ground():
    """At 20 feet, by hand: 0.177 + 0.01646 = 0.19346; 20/0.19346^1.2 = 143.6 ft; 0.19346^−0.4 = 1.929."""
    size = scales(20.0 * FOOT, W20["light"])
    assert size.vertical_length == pytest.approx(20.0 * FOOT)
    assert size.horizontal_length == pytest.approx(143.6 * FOOT, rel=1e-3)
    assert size.vertical == pytest.approx(0.7717)
    assert size.horizontal == pytest.approx(1.929 * 0.7717, rel=1e-3)


@given(height=st.floats(3.1, 300.0))
def test_severity_scales_the_size_and_not_the_length(height):
    light, severe = scales(height, W20["light"]), scales(height, W20["severe"])
    assert severe[:2] == light[:2]
    np.testing.assert_allclose(severe[2:], 3.0 * np.array(light[2:]), rtol=1e-3)


HEIGHT, AIRSPEED = 6.0, 20.0


@pytest.fixture(scope="module")
def record():
    """Components (n, 3), twenty a second, of ten vehicles for 150 s each: some 800 lengths of the longest."""
    found = []
    for seed in range(10):
        turbulence = Turbulence(W20["light"], np.random.default_rng(seed))
        rows = []
        for now in range(0, 150_000_000, 5 * PERIOD):
            turbulence.advance(now, HEIGHT, AIRSPEED)
            rows.append(turbulence.components)
        found.append(rows[1:])
    return np.array(found)


def test_the_variances_are_those_of_the_standard(record):
    size = scales(HEIGHT, W20["light"])
    np.testing.assert_allclose(
        record.std(axis=(0, 1)), [size.horizontal, size.horizontal, size.vertical], rtol=0.1
    )
    np.testing.assert_allclose(record.mean(axis=(0, 1)), 0.0, atol=0.2)
    across = np.corrcoef(record.reshape(-1, 3).T)
    np.testing.assert_allclose(across, np.eye(3), atol=0.1)


@pytest.mark.parametrize("lag", [0.05, 0.5, 1.0, 2.0, 4.0])
def test_the_correlations_are_those_of_the_spectra(record, lag):
    """Along: e^(−x/L); across and down: e^(−x/L) (1 − x/2L), x being the way through the field."""
    size = scales(HEIGHT, W20["light"])
    steps = round(lag / 0.05)
    seen = np.mean(record[:, :-steps] * record[:, steps:], axis=(0, 1)) / record.var(axis=(0, 1))
    flat, steep = (lag * AIRSPEED / length for length in size[:2])
    expected = [math.exp(-flat), math.exp(-flat) * (1.0 - flat / 2), math.exp(-steep) * (1.0 - steep / 2)]
    np.testing.assert_allclose(seen, expected, atol=0.1)


@given(stops=st.lists(st.integers(0, 3_000_000), min_size=1, max_size=10))
def test_the_air_does_not_depend_on_who_asks(stops):
    """While height and speed are the same."""
    config = WeatherConfig(wind=(2.0, 1.0, 0.0), turbulence="moderate")
    often, seldom = Weather(config, 1, 11), Weather(config, 1, 11)
    told = {now: often.wind(now, 5.0) for now in sorted({*range(0, 3_000_001, 50_000), *stops})}
    assert all(seldom.wind(now, 5.0) == told[now] for now in sorted(stops))


def test_every_vehicle_and_every_seed_has_its_own_turbulence():
    config = WeatherConfig(turbulence="light")
    winds = [
        Weather(config, seed, i).wind(1_000_000, 5.0) for seed, i in ((1, 11), (1, 12), (2, 11), (1, 11))
    ]
    assert winds[0] == winds[3]
    assert len(set(winds)) == 3


def test_it_blows_along_the_wind_at_every_height_with_a_size_of_that_height():
    """Up a chimney: the state has variance one, so what is felt has at once the size of where it is."""
    low, high = (Turbulence(10.0, np.random.default_rng(5)) for _ in range(2))
    low.advance(PERIOD, 5.0, 10.0)
    high.advance(PERIOD, 5.0, 10.0)
    high.advance(2 * PERIOD, 100.0, 1e-9)
    low.advance(2 * PERIOD, 5.0, 1e-9)
    ratio = scales(100.0, 10.0).horizontal / scales(5.0, 10.0).horizontal
    assert high.components[0] / low.components[0] == pytest.approx(ratio, rel=0.1)


def test_turbulence_turns_with_the_wind():
    """The same draws, seen in axes along the wind, whatever its direction."""
    seen = []
    for angle in (0.0, 1.0, 2.5):
        c, s = math.cos(angle), math.sin(angle)
        weather = Weather(WeatherConfig(wind=(8.0 * s, 8.0 * c, 0.0), turbulence="light"), 1, 11)
        north, east, down = weather.wind(2_000_000, 5.0)
        seen.append((c * north + s * east, c * east - s * north, down))
    np.testing.assert_allclose(seen[1:], [seen[0]] * 2, atol=1e-9)
