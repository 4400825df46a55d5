"""A vehicle that has a key obeys who has it, and nobody else: pymavlink's clients on the other side."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as dialect

from mavlink_bridge.key import Key
from mavlink_bridge.wire.codec import Codec
from mavlink_bridge.wire.signing import EPOCH, UNIT, Refusal, Signing
from sitl.autopilot.saved import Saved
from tests.sitl.autopilot_rig import ARM, FLAVOURS, SET_MODE, TAKEOFF, Rig, setpoint
from tests.sitl.outside_client import Client

KEY, OTHER = Key.of_passphrase("correct horse"), Key.of_passphrase("battery staple")
BOOT = 1_780_000_000_000_000
"""Unix time of the vehicle's boot (µs), in 2026."""
STAMP = (BOOT - EPOCH) // UNIT
REPOSITION, FORCED = 192, 21196.0


def rig(flavour: str = "ardupilot", **more: Any) -> Rig:
    return Rig(flavour, signing=Signing(KEY), epoch=BOOT, **more)


def enter(client: Client, key: Key | None = KEY, stamp: int = STAMP + 1) -> Client:
    """With pymavlink's own function for it, which wants a connection."""
    connection = SimpleNamespace(mav=client.peer)
    if key is None:
        mavutil.mavfile.disable_signing(connection)
    else:
        allowed = client.peer.signing.allow_unsigned_callback
        mavutil.mavfile.setup_signing(connection, bytes(key), True, allowed, stamp, 0)
    return client


def up(flavour: str = "ardupilot") -> Client:
    client = enter(Client(rig(flavour)))
    client.wait(1.2)
    return client


def command(number: int, *params: float) -> Any:
    values = (*map(float, params), *([0.0] * 7))[:7]
    return dialect.MAVLink_command_long_message(11, 1, number, 0, *values)


def setup(key: Key, stamp: int = STAMP + 1, to: tuple[int, int] = (11, 1)) -> Any:
    return dialect.MAVLink_setup_signing_message(*to, list(bytes(key)), stamp)


def acks(found: list[Any]) -> list[int]:
    return [m.result for m in found if m.get_type() == "COMMAND_ACK"]


# Who has the key


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_client_of_pymavlink_with_the_key_flies_it(flavour: str) -> None:
    client = up(flavour)
    assert client.peer.signing.goodsig_count == len(client.received)
    assert client.of("LOCAL_POSITION_NED")
    guided = (1, 4) if flavour == "ardupilot" else None
    if guided:
        assert client.command(SET_MODE, *guided) == 0
    assert client.command(ARM, 1) == 0
    height = 5.0 if flavour == "ardupilot" else client.rig.config.altitude + 5.0
    assert client.command(TAKEOFF, 0, 0, 0, 0, 0, 0, height) == 0
    client.wait(9.0)
    assert client.of("LOCAL_POSITION_NED")[-1].z == pytest.approx(-5.0, abs=0.1)
    target = dialect.MAVLink_set_position_target_local_ned_message(
        0, 11, 1, 1, 0x9F8, 3.0, 0.0, -5.0, 0, 0, 0, 0, 0, 0, 0.0, 0.0
    )
    client.send(target)
    if not guided:
        for _ in range(50):
            client.send(target)
        assert client.command(SET_MODE, 1, 6) == 0
    for _ in range(60):
        client.send(target)
        client.wait(0.1)
    assert client.of("LOCAL_POSITION_NED")[-1].x == pytest.approx(3.0, abs=0.1)
    assert client.command(21) == 0
    client.wait(12.0)
    assert not client.rig.autopilot.armed
    assert client.peer.signing.badsig_count == 0
    assert client.peer.signing.goodsig_count == len(client.received)


def test_a_client_whose_clock_is_behind_catches_up_by_listening() -> None:
    client = enter(Client(rig()), stamp=STAMP - 3_600 * 100_000)
    # It has heard nothing yet: its stamps are of an hour ago.
    assert client.send(command(520)) != []
    assert acks(client.received) == []
    assert client.command(520) == 0


def test_our_own_codec_and_pymavlink_are_two_clients_of_one_vehicle() -> None:
    one, signing = up(), Signing(KEY)
    signing.present(BOOT + one.rig.now)
    one.rig.step_bytes(Codec(None, signing).encode(setpoint()))
    one.wait(0.05)
    assert one.texts == ["Set-point ignored: not in GUIDED"]
    assert one.command(520) == 0


# Who has not


def attempts(peer: Any) -> list[bytes]:
    """What a stranger would try."""
    orders = (
        command(SET_MODE, 1, 5),
        command(ARM, 0, FORCED),
        command(21),
        setup(OTHER),
        setup(Key(bytes(32)), 0),
    )
    return [message.pack(peer) for message in orders]


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("key", [None, OTHER])
def test_without_the_key_nothing_is_obeyed_answered_or_changed(flavour: str, key: Key | None) -> None:
    vehicle = rig(flavour, start_height=5.0)
    stranger = enter(Client(vehicle), key)
    stranger.peer.signing.allow_unsigned_callback = lambda *_: True
    mode = vehicle.autopilot.mode
    for data in attempts(stranger.peer):
        vehicle.step_bytes(data)
    found = stranger.wait(0.5)
    assert acks(found) == []
    assert vehicle.autopilot.armed
    assert vehicle.autopilot.mode is mode
    reason = Refusal.UNSIGNED if key is None else Refusal.FORGED
    assert vehicle.texts == [f"Messages do not count: {reason.value}"]
    # Those who have the key are heard as before.
    assert enter(Client(vehicle, (254, 1))).command(520) == 0


def test_a_replayed_order_is_refused_at_once_later_and_over_a_restart() -> None:
    client = up()
    vehicle = client.rig
    order = command(SET_MODE, 1, 4).pack(client.peer)
    vehicle.step_bytes(order)
    client.wait(0.05)
    assert client.command(SET_MODE, 1, 5) == 0
    mode = vehicle.autopilot.mode
    for _ in range(3):
        vehicle.step_bytes(order)
        client.wait(1.0)
        assert vehicle.autopilot.mode is mode
    # With a clock, and without one by what it kept.
    for epoch, saved in ((BOOT + vehicle.now, Saved()), (0, vehicle.autopilot.saved)):
        again = Rig(signing=Signing(KEY), epoch=epoch, saved=saved)
        again.run(1.2)
        before = again.autopilot.mode
        again.step_bytes(order)
        assert again.autopilot.mode is before
        assert again.autopilot.saved.signed_until > STAMP


def test_who_is_refused_is_told_now_and_then_and_no_more() -> None:
    vehicle = rig()
    stranger = dialect.MAVLink(None, 255, 190)
    for _ in range(2400):
        vehicle.step_bytes(command(520).pack(stranger))
    assert len(vehicle.texts) == 3


# Keys over the link


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_a_client_sets_a_key_changes_it_and_takes_it_away(flavour: str) -> None:
    """As MAVProxy: SETUP_SIGNING without a signature, and from then on all with one."""
    client = Client(Rig(flavour, signing_setup="obeyed", epoch=BOOT))
    client.wait(1.2)
    assert client.command(520) == 0
    stamp = STAMP + 200_000
    client.send(setup(KEY, stamp))
    enter(client, KEY, stamp)
    assert client.command(520) == 0
    assert client.texts[-1] == "Signing is on"
    stranger = Client(client.rig, (254, 190))
    stranger.peer.signing.allow_unsigned_callback = lambda *_: True
    stranger.send(command(520), setup(OTHER, stamp + 10))
    assert acks(stranger.received) == []
    # What confirms the change is signed with the new key already.
    client.peer.signing.allow_unsigned_callback = lambda *_: True
    client.send(setup(OTHER, stamp + 100))
    enter(client, OTHER, client.peer.signing.timestamp)
    assert client.command(520) == 0
    client.send(setup(Key(bytes(32)), 0))
    enter(client, None)
    assert client.command(520) == 0
    assert client.texts[-1] == "Signing is off"


@pytest.mark.parametrize(
    ("settings", "message", "said"),
    [
        ({}, setup(KEY), "keys come from a file here"),
        ({"signing_setup": "obeyed", "start_height": 5.0}, setup(KEY), "armed"),
        ({"signing_setup": "obeyed"}, setup(KEY, 1 << 48), "no such time"),
        ({"signing_setup": "obeyed"}, setup(Key(bytes(32)), 5), "a key of zeros"),
        ({"signing_setup": "obeyed"}, setup(KEY, to=(0, 0)), None),
        ({"signing_setup": "obeyed"}, setup(KEY, to=(12, 1)), None),
    ],
)
def test_a_key_that_is_not_taken_changes_nothing(
    settings: dict[str, Any], message: Any, said: str | None
) -> None:
    client = Client(Rig(**settings))
    client.wait(0.1)
    found = client.send(message)
    texts = [m.text for m in found if m.get_type() == "STATUSTEXT"]
    assert texts == ([f"Signing setup refused: {said}"] if said else [])
    assert client.command(520) == 0
    assert not any(m.get_signed() for m in client.received)


def test_no_key_is_kept_or_shown_or_said() -> None:
    client = Client(Rig(signing_setup="obeyed"))
    client.send(setup(KEY))
    vehicle = client.rig.autopilot
    client.rig.run(1.0)
    for text in (vehicle.saved.model_dump_json(), client.rig.config.model_dump_json(), repr(vars(vehicle))):
        assert bytes(KEY).hex() not in text
        assert repr(bytes(KEY)) not in text
    assert bytes(KEY) not in client.rig.bytes


def test_without_a_key_a_vehicle_says_the_same_bytes() -> None:
    """Signing costs nothing where it is off."""
    plain, able = Rig(), Rig(signing_setup="obeyed")
    for one in (plain, able):
        one.run(2.0)
        one.guided()
    assert plain.bytes == able.bytes


def test_a_companion_of_another_key_is_no_companion() -> None:
    vehicle = rig(start_height=5.0)
    writer = Codec(None, Signing(OTHER))
    for _ in range(100):
        vehicle.step_bytes(writer.encode(setpoint(position=(5.0, 0.0, -5.0))))
    assert vehicle.position[0] == pytest.approx(0.0, abs=0.05)
    signing = Signing(KEY)
    signing.present(BOOT + vehicle.now)
    friend = Codec(None, signing)
    for _ in range(400):
        vehicle.step_bytes(friend.encode(setpoint(position=(5.0, 0.0, -5.0))))
    assert vehicle.position[0] > 1.0
