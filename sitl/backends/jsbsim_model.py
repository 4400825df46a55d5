"""A vehicle as a JSBSim model: the aircraft file, written from a ``VehicleConfig``.

It is whole by itself. What it is given are the properties ``rotor-i/command-rad_sec``, the speeds asked of
the motors, and ``rotor-i/left``, what each rotor has left of its motor's speed. Motor lag, thrust, torque,
rotor drag and rolling moment are JSBSim functions, so that they feel JSBSim's own air; the rigid body,
gravity, the turning Earth and the ground are JSBSim's.

Functions work in SI and end in pounds and feet, as ``<aerodynamics>`` wants them. Places are in JSBSim's
structural frame, x aft, y right, z up, with the centre of mass at its origin.
"""

from __future__ import annotations

import math
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from sitl.vehicle.config import Rotor, VehicleConfig
from sitl.vehicle.ground import GRAVITY

FOOT: Final = 0.3048
"""m."""
POUND: Final = 0.45359237 * 9.80665
"""N."""

_STIFFEST: Final = 50.0
"""Most that the landing gear's own frequency is to be (rad/s): a weight that sinks in by 4 mm."""
_STIFFEST_PER_STEP: Final = 0.4
"""Most that it turns in one physics step (rad), which JSBSim's explicit integration can follow."""
_LEGS: Final = 4
_AT_REST: Final = 1e-3
_TIP_SHARE: Final = 0.1
"""Stiffness of a rotor tip that touches the ground, over that of the whole gear."""


def command_property(rotor: int) -> str:
    """Where the speed asked of a motor goes (rad/s)."""
    return f"rotor-{rotor}/command-rad_sec"


def motor_property(rotor: int) -> str:
    """The speed of a motor (rad/s)."""
    return f"rotor-{rotor}/motor-rad_sec"


def left_property(rotor: int) -> str:
    """What a rotor has left of its motor's speed (0…1)."""
    return f"rotor-{rotor}/left"


def aircraft(config: VehicleConfig, *, isa: bool = False) -> str:
    """The text of the aircraft file.

    With ``isa`` thrust, torque and drag are in proportion to the density of JSBSim's atmosphere, and the
    vehicle's numbers are those at sea level; else they hold everywhere, as in our own physics.
    """
    root = Element("fdm_config", name=config.name, version="2.0", release="BETA")
    metrics = SubElement(root, "metrics")
    area = 0.25 * math.pi * config.span**2
    _value(metrics, "wingarea", area, "M2")
    _value(metrics, "wingspan", config.span, "M")
    _value(metrics, "chord", config.span, "M")
    _place(metrics, (0.0, 0.0, 0.0), name="AERORP")
    mass = SubElement(root, "mass_balance")
    for axis, inertia in zip("xyz", config.inertia, strict=True):
        _value(mass, f"i{axis}{axis}", inertia, "KG*M2")
    _value(mass, "emptywt", config.mass, "KG")
    _place(mass, (0.0, 0.0, 0.0), name="CG")
    _ground_reactions(root, config)
    _motors(root, config)
    _aerodynamics(root, config, isa=isa)
    indent(root)
    return tostring(root, encoding="unicode")


def _value(parent: Element, tag: str, value: float, unit: str | None = None) -> None:
    element = SubElement(parent, tag, {} if unit is None else {"unit": unit})
    element.text = repr(float(value))


def _place(parent: Element, body: tuple[float, float, float], **attributes: str) -> None:
    """A location (m), given forward-right-down."""
    place = SubElement(parent, "location", {"unit": "M", **attributes})
    for axis, part in zip("xyz", (-body[0], body[1], -body[2]), strict=True):
        _value(place, axis, part)


# The ground


def _ground_reactions(root: Element, config: VehicleConfig) -> None:
    """Legs that carry the weight with the centre of mass at the height of rest, and rotor tips for who falls
    over."""
    reactions = SubElement(root, "ground_reactions")
    frequency = min(_STIFFEST, _STIFFEST_PER_STEP / (config.physics_period * 1e-6))
    stiffness = config.mass * frequency**2
    damping = 2.0 * config.mass * frequency
    # Each spring gives way under the weight by as much as its foot stands lower.
    foot = config.rest_height + GRAVITY / frequency**2
    for leg in range(_LEGS):
        angle = math.tau * (leg + 0.5) / _LEGS
        x, y = config.gear_radius * math.cos(angle), config.gear_radius * math.sin(angle)
        _contact(reactions, f"leg-{leg}", (x, y, foot), stiffness / _LEGS, damping / _LEGS, config)
    for index, rotor in enumerate(config.rotors):
        x, y, z = rotor.position
        share = max(1.0, 0.5 * config.span / rotor.arm)
        _contact(
            reactions,
            f"tip-{index}",
            (share * x, share * y, z),
            _TIP_SHARE * stiffness,
            _TIP_SHARE * damping,
            config,
        )


def _contact(
    reactions: Element,
    name: str,
    body: tuple[float, float, float],
    stiffness: float,
    damping: float,
    config: VehicleConfig,
) -> None:
    """A point that touches the ground: stiffness in N/m, damping in N s/m."""
    contact = SubElement(reactions, "contact", type="STRUCTURE", name=name)
    _place(contact, body)
    _value(contact, "static_friction", config.ground_friction)
    _value(contact, "dynamic_friction", config.ground_friction)
    _value(contact, "spring_coeff", stiffness, "N/M")
    _value(contact, "damping_coeff", damping, "N/M/SEC")
    _value(contact, "damping_coeff_rebound", damping, "N/M/SEC")


# Motors and rotors


def _motors(root: Element, config: VehicleConfig) -> None:
    """First-order lag, solved exactly for a command that is held: ω ← c + e^(−h/τ) (ω − c). A motor that is
    told to stop ends at zero instead of creeping through denormal numbers."""
    system = SubElement(root, "system", name="motors")
    step = config.physics_period * 1e-6
    rising, falling = (math.exp(-step / tau) for tau in (config.tau_up, config.tau_down))
    for index in range(len(config.rotors)):
        for name, value in ((command_property(index), 0.0), (left_property(index), 1.0)):
            SubElement(system, "property", value=repr(value)).text = name
        channel = SubElement(system, "channel", name=f"motor-{index}")
        motor, command = motor_property(index), command_property(index)
        excess = _of("difference", motor, command)
        kept = _of("ifthen", _of("gt", motor, command), falling, rising)
        component = SubElement(channel, "fcs_function", name=motor)
        speed = _of("sum", command, _of("product", kept, excess))
        turning = _of("gt", _of("sum", motor, command), _AT_REST)
        SubElement(component, "function").append(_of("ifthen", turning, speed, 0.0))


def _aerodynamics(root: Element, config: VehicleConfig, *, isa: bool) -> None:
    """The rotors' wrench, the RotorS model as in ``sitl.vehicle.rotors``: thrust k_f ω² along −b3, torque
    k_m times it, and −c ω v⊥ for drag and for the rolling moment, v⊥ being the velocity of the hub through
    the air."""
    aerodynamics = SubElement(root, "aerodynamics")
    density: tuple[str, ...] = ("atmosphere/sigma",) if isa else ()
    sums: dict[str, list[Element]] = {axis: [] for axis in ("X", "Y", "Z", "ROLL", "PITCH", "YAW")}
    for index, rotor in enumerate(config.rotors):
        for axis, terms in _rotor(aerodynamics, index, rotor, config, density).items():
            sums[axis] += terms
    for axis, terms in sums.items():
        element = SubElement(aerodynamics, "axis", name=axis)
        function = SubElement(element, "function", name=f"aero/rotors/{axis.lower()}")
        force = axis in ("X", "Y", "Z")
        to_pounds = 1.0 / POUND if force else 1.0 / (POUND * FOOT)
        function.append(_of("product", to_pounds, _of("sum", *terms)))


def _rotor(
    aerodynamics: Element, index: int, rotor: Rotor, config: VehicleConfig, density: tuple[str, ...]
) -> dict[str, list[Element]]:
    """Define the functions of one rotor; its terms (N, N m) in the sums of the axes."""
    x, y, z = rotor.position
    name = f"rotor-{index}"

    def define(what: str, function: Element) -> str:
        SubElement(aerodynamics, "function", name=f"{name}/{what}").append(function)
        return f"{name}/{what}"

    speed = define("speed-rad_sec", _of("product", left_property(index), motor_property(index)))
    thrust = define("thrust-N", _of("product", config.k_f, speed, speed, *density))
    # The air is the same all over the vehicle: JSBSim's turning of it (p-aero-rad_sec) is left out.
    p, q, r = (f"velocities/{rate}-rad_sec" for rate in "pqr")
    hub_x = define("hub-u-m_sec", _hub("u", _of("product", z, q), _of("product", -y, r)))
    hub_y = define("hub-v-m_sec", _hub("v", _of("product", x, r), _of("product", -z, p)))
    push_x = define("push-x-N", _of("product", -config.rotor_drag, speed, hub_x, *density))
    push_y = define("push-y-N", _of("product", -config.rotor_drag, speed, hub_y, *density))
    roll = -config.rolling_moment
    return {
        "X": [_of("product", 1.0, push_x)],
        "Y": [_of("product", 1.0, push_y)],
        "Z": [_of("product", -1.0, thrust)],
        "ROLL": [
            _of("product", -y, thrust),
            _of("product", -z, push_y),
            _of("product", roll, speed, hub_x, *density),
        ],
        "PITCH": [
            _of("product", x, thrust),
            _of("product", z, push_x),
            _of("product", roll, speed, hub_y, *density),
        ],
        "YAW": [
            _of("product", rotor.spin_sign * config.k_m, thrust),
            _of("product", x, push_y),
            _of("product", -y, push_x),
        ],
    }


def _hub(axis: str, *turning: Element) -> Element:
    """A component (m/s) of a hub's velocity through the air."""
    return _of("sum", _of("product", FOOT, f"velocities/{axis}-aero-fps"), *turning)


def _of(operation: str, *arguments: str | float | Element) -> Element:
    """A JSBSim operation on properties, numbers and other operations."""
    element = Element(operation)
    for argument in arguments:
        if isinstance(argument, str):
            SubElement(element, "property").text = argument
        elif isinstance(argument, Element):
            element.append(argument)
        else:
            _value(element, "value", argument)
    return element
