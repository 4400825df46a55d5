"""Set-points: consistent position, velocity, acceleration and yaw at a bounded look-ahead of the horizon.

The paper sends the last state, 1.6 s ahead: 8 m at 5 m/s. A cascaded position controller that follows a point
so far ahead exceeds its speed limit. A look-ahead (``setpoint_lead_us``) equal to the link's delay makes the
set-point correct when it arrives; the paper's choice is 1 600 000 µs.
"""

from __future__ import annotations

from math import isfinite

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from companion.goals.heading import Yaw
from companion.values.horizon import Array, Horizon
from mavlink_bridge.frames import LocalFrame
from mavlink_bridge.messages import SetpointLocal, Source

NO_ACCELERATION: Array = np.zeros(3)
"""No compensation."""
NO_ACCELERATION.flags.writeable = False
UNBOUNDED: Array = np.array([[-np.inf] * 3, [np.inf] * 3])
UNBOUNDED.flags.writeable = False


def setpoint(
    time: int,
    since_boot: int,
    horizon: Horizon,
    yaw: Yaw,
    local: LocalFrame,
    own: Source,
    mask: int,
    compensation: Array = NO_ACCELERATION,
    bias: Array = NO_ACCELERATION,
    velocities: Array = UNBOUNDED,
    lead: int = 0,
    added: Array = NO_ACCELERATION,
) -> SetpointLocal:
    """Return SET_POSITION_TARGET_LOCAL_NED in the vehicle's own local frame.

    It contains the state of ``horizon`` at ``time`` (µs), and ``yaw``. ``since_boot`` (µs): time_boot_ms;
    ``own`` is the sender, and its system id the target's; ``mask`` is POSITION_TARGET_TYPEMASK.
    ``compensation`` (3,), m/s², fleet-local ENU, is added to the acceleration. ``bias`` (3,), m/s, is added
    to the velocity (see ``tracking.py``); the sum is then clipped on each axis to the interval from the least
    to the largest velocity of ``velocities`` (2, 3), extended to the planned velocity where that is outside;
    then ``added`` (3,), m/s, is added (see ``plan_feedforward.py``). The acceleration is that of the horizon
    ``lead`` µs later.
    """
    motion = horizon.at(time)
    acceleration = horizon.at(time + lead).acceleration if lead else motion.acceleration
    velocity = motion.velocity
    if bias is not NO_ACCELERATION:
        least, most = np.minimum(velocity, velocities[0]), np.maximum(velocity, velocities[1])
        velocity = np.minimum(np.maximum(velocity + bias, least), most)
    if added is not NO_ACCELERATION:
        velocity = velocity + added
    place, speed, change = local.motion_to_local(motion.position, velocity, acceleration + compensation)
    return SetpointLocal(
        own,
        since_boot,
        own.system,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
        mavlink.MAV_FRAME_LOCAL_NED,
        mask,
        place,
        speed,
        change,
        local.yaw_to_local(yaw.yaw),
        # NED yaw is clockwise: the rate changes sign with the frame.
        -yaw.rate,
    )


def is_finite(message: SetpointLocal) -> bool:
    """Return whether no field is NaN or infinite: a single NaN in a used field has crashed an autopilot."""
    return isfinite(
        sum(message.position)
        + sum(message.velocity)
        + sum(message.acceleration)
        + message.yaw
        + message.yaw_rate
    )
