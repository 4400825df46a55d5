"""Vehicle as a JSBSim model: the aircraft file, generated from a ``VehicleConfig``.

The file is complete. Its inputs are the properties ``rotor-i/command-rad_sec``, the commanded speeds of the
motors, and ``rotor-i/left``, the remaining fraction of each rotor's speed. Motor lag, thrust, torque, rotor
drag and rolling moment are JSBSim functions, so that JSBSim's own air acts on them; the rigid body, gravity,
the rotating Earth and the ground are JSBSim's.

Functions work in SI and end in pounds and feet, as ``<aerodynamics>`` requires. Locations are in JSBSim's
structural frame, x aft, y right, z up, with the centre of mass at its origin.
"""

from __future__ import annotations

import math
from typing import Final
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from sitl.vehicle.config import Rotor, VehicleConfig
from sitl.vehicle.ground import GRAVITY

FOOT: Final = 0.3048
"""One foot (m)."""
POUND: Final = 0.45359237 * 9.80665
"""One pound-force (N)."""

_MAX_FREQUENCY: Final = 50.0
"""Upper limit of the landing gear's natural frequency (rad/s): a static deflection of 4 mm."""
_MAX_PHASE_PER_STEP: Final = 0.4
"""Upper limit of that frequency times the physics step (rad), for JSBSim's explicit integration."""
_LEGS: Final = 4
_AT_REST: Final = 1e-3
_TIP_SHARE: Final = 0.1
"""Stiffness of a rotor tip that touches the ground, over that of the whole gear."""


def command_property(rotor: int) -> str:
    """Return the property of a motor's commanded speed (rad/s)."""
    return f"rotor-{rotor}/command-rad_sec"


def motor_property(rotor: int) -> str:
    """Return the property of a motor's speed (rad/s)."""
    return f"rotor-{rotor}/motor-rad_sec"


def left_property(rotor: int) -> str:
    """Return the property of the remaining fraction (0…1) of a rotor's speed."""
    return f"rotor-{rotor}/left"


def aircraft(config: VehicleConfig, *, isa: bool = False) -> str:
    """Return the text of the aircraft file.

    With ``isa`` thrust, torque and drag are proportional to the density of JSBSim's atmosphere, and the
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
    """Add a location (m), given forward-right-down."""
    place = SubElement(parent, "location", {"unit": "M", **attributes})
    for axis, part in zip("xyz", (-body[0], body[1], -body[2]), strict=True):
        _value(place, axis, part)


# Ground


def _ground_reactions(root: Element, config: VehicleConfig) -> None:
    """Add legs that carry the weight at the rest height, and rotor tips for a vehicle that falls over."""
    reactions = SubElement(root, "ground_reactions")
    frequency = min(_MAX_FREQUENCY, _MAX_PHASE_PER_STEP / (config.physics_period * 1e-6))
    stiffness = config.mass * frequency**2
    damping = 2.0 * config.mass * frequency
    # Each foot is lower than the ground at rest by the deflection of its spring under the weight.
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
    """Add a point that touches the ground: stiffness in N/m, damping in N s/m."""
    contact = SubElement(reactions, "contact", type="STRUCTURE", name=name)
    _place(contact, body)
    _value(contact, "static_friction", config.ground_friction)
    _value(contact, "dynamic_friction", config.ground_friction)
    _value(contact, "spring_coeff", stiffness, "N/M")
    _value(contact, "damping_coeff", damping, "N/M/SEC")
    _value(contact, "damping_coeff_rebound", damping, "N/M/SEC")


# Motors and rotors


def _motors(root: Element, config: VehicleConfig) -> None:
    """Add the motors: first-order lag, solved exactly for a held command, ω ← c + e^(−h/τ) (ω − c).

    ω is the motor's speed, c the commanded one, h the step, τ the time constant. A motor commanded to stop
    ends at zero instead of decaying through denormal numbers.
    """
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
    """Add the rotors' wrench, the RotorS model as in ``sitl.vehicle.rotors``.

    Thrust is k_f ω² along −b3 (body axis up) and torque is k_m times thrust. Drag and rolling moment are −c ω
    v⊥, each with its own c, where v⊥ is the hub's velocity through the air in the plane of the rotor.
    """
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
    """Define the functions of one rotor and return its terms (N, N m) in the sums of the axes."""
    x, y, z = rotor.position
    name = f"rotor-{index}"

    def define(what: str, function: Element) -> str:
        SubElement(aerodynamics, "function", name=f"{name}/{what}").append(function)
        return f"{name}/{what}"

    speed = define("speed-rad_sec", _of("product", left_property(index), motor_property(index)))
    thrust = define("thrust-N", _of("product", config.k_f, speed, speed, *density))
    # The air is uniform over the vehicle: the rotation of JSBSim's air (p-aero-rad_sec) is not used.
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
    """Return a component (m/s) of a hub's velocity through the air."""
    return _of("sum", _of("product", FOOT, f"velocities/{axis}-aero-fps"), *turning)


def _of(operation: str, *arguments: str | float | Element) -> Element:
    """Return a JSBSim operation on properties, numbers and other operations."""
    element = Element(operation)
    for argument in arguments:
        if isinstance(argument, str):
            SubElement(element, "property").text = argument
        elif isinstance(argument, Element):
            element.append(argument)
        else:
            _value(element, "value", argument)
    return element
