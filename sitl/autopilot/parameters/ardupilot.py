"""Parameters of ArduCopter 4.6 that clients look for, with the firmware's types, defaults and units.

The table holds about a fifth of the firmware's parameters. Most have no effect here; those with a ``Bound``
are settings of the simulation. The module is long because it is a table.
"""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from sitl.autopilot.parameters.parameter import Bound, Kind, Parameter

_I8, _I16, _I32, _F32 = Kind.INT8, Kind.INT16, Kind.INT32, Kind.REAL32
_Row = (
    tuple[str, Kind, float]
    | tuple[str, Kind, float, float, float]
    | tuple[str, Kind, float, float, float, str]
)
# Motor outputs 1 to 8 are functions 33 to 40.
_MOTOR_1: Final = 33
# FRAME_CLASS by the number of rotors.
_CLASSES: Final = {4: 1, 6: 2, 8: 3}

STREAMS: Final = {
    "RAW_SENS": mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    "EXT_STAT": mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    "RC_CHAN": mavlink.MAV_DATA_STREAM_RC_CHANNELS,
    "RAW_CTRL": mavlink.MAV_DATA_STREAM_RAW_CONTROLLER,
    "POSITION": mavlink.MAV_DATA_STREAM_POSITION,
    "EXTRA1": mavlink.MAV_DATA_STREAM_EXTRA1,
    "EXTRA2": mavlink.MAV_DATA_STREAM_EXTRA2,
    "EXTRA3": mavlink.MAV_DATA_STREAM_EXTRA3,
}
"""MAV_DATA_STREAM by the end of the name of the SR0_ parameter that sets the rate of its messages."""

_DEGREE: Final = math.radians(1.0)
_SWITCH: Final = ((0, "off"), (1, "on"))
_ACTIONS: Final = ((0, "warn"), (1, "land"), (2, "return"))

BOUND: Final = {
    "SYSID_THISMAV": Bound("system_id"),
    "GUID_TIMEOUT": Bound("guided_timeout"),
    "DISARM_DELAY": Bound("disarm_delay"),
    "LAND_SPEED": Bound("land_speed", 0.01),
    "WPNAV_SPEED": Bound("waypoint_speed", 0.01),
    "WPNAV_SPEED_UP": Bound("waypoint_climb", 0.01),
    "WPNAV_SPEED_DN": Bound("waypoint_sink", 0.01),
    "WPNAV_RADIUS": Bound("acceptance_radius", 0.01),
    "RTL_ALT": Bound("return_height", 0.01),
    "RTL_LOIT_TIME": Bound("return_pause", 0.001),
    "PSC_JERK_XY": Bound("ardupilot.jerk"),
    "PSC_POSXY_P": Bound("ardupilot.position"),
    "PSC_VELXY_P": Bound("ardupilot.velocity"),
    "PSC_VELXY_I": Bound("ardupilot.integral"),
    "PSC_VELXY_D": Bound("ardupilot.derivative"),
    "PSC_JERK_Z": Bound("ardupilot.jerk_z"),
    "PSC_POSZ_P": Bound("ardupilot.position_z"),
    "PSC_VELZ_P": Bound("ardupilot.velocity_z"),
    "PSC_VELZ_FLTE": Bound("ardupilot.filter_z_hz"),
    "PSC_ACCZ_P": Bound("ardupilot.throttle"),
    "PSC_ACCZ_I": Bound("ardupilot.throttle_integral"),
    "PSC_ACCZ_FLTE": Bound("ardupilot.throttle_filter_hz"),
    "WPNAV_ACCEL": Bound("ardupilot.acceleration", 0.01),
    "WPNAV_ACCEL_Z": Bound("ardupilot.acceleration_z", 0.01),
    "ANGLE_MAX": Bound("ardupilot.tilt", 0.01 * _DEGREE),
    "BATT_LOW_VOLT": Bound("battery_failsafe.low_voltage"),
    "BATT_CRT_VOLT": Bound("battery_failsafe.critical_voltage"),
    "BATT_FS_LOW_ACT": Bound("battery_failsafe.low_action", options=_ACTIONS),
    "BATT_FS_CRT_ACT": Bound("battery_failsafe.critical_action", options=_ACTIONS),
    "FENCE_ENABLE": Bound("fence.enabled", options=_SWITCH),
    "FENCE_TYPE": Bound("fence.kinds"),
    "FENCE_ALT_MIN": Bound("fence.floor"),
    "FENCE_ALT_MAX": Bound("fence.height"),
    "FENCE_RADIUS": Bound("fence.radius"),
    "FENCE_ACTION": Bound("fence.action", options=((0, "warn"), (1, "return"), (2, "land"), (4, "hold"))),
    "FOLL_ENABLE": Bound("follow.enabled", options=_SWITCH),
    "FOLL_SYSID": Bound("follow.system"),
    "FOLL_DIST_MAX": Bound("follow.limit"),
    "FOLL_OFS_TYPE": Bound("follow.axes", options=((0, "north"), (1, "heading"))),
    "FOLL_OFS_X": Bound("follow.x"),
    "FOLL_OFS_Y": Bound("follow.y"),
    "FOLL_OFS_Z": Bound("follow.z"),
}


def _channel(k: int) -> tuple[_Row, ...]:
    pwm = 800, 2200, "PWM"
    return (
        (f"RC{k}_MIN", _I16, 1100, *pwm),
        (f"RC{k}_TRIM", _I16, 1500, *pwm),
        (f"RC{k}_MAX", _I16, 1900, *pwm),
        (f"RC{k}_REVERSED", _I8, 0, 0, 1),
        (f"RC{k}_OPTION", _I16, 0),
    )


def _output(k: int, rotors: int) -> tuple[_Row, ...]:
    pwm = 800, 2200, "PWM"
    return (
        (f"SERVO{k}_MIN", _I16, 1100, *pwm),
        (f"SERVO{k}_MAX", _I16, 1900, *pwm),
        (f"SERVO{k}_TRIM", _I16, 1500, *pwm),
        (f"SERVO{k}_REVERSED", _I8, 0, 0, 1),
        (f"SERVO{k}_FUNCTION", _I16, _MOTOR_1 - 1 + k if k <= rotors else 0),
    )


_ROWS: Final[tuple[_Row, ...]] = (
    ("FORMAT_VERSION", _I16, 120),
    ("SYSID_THISMAV", _I16, 1, 1, 255),
    ("SYSID_MYGCS", _I16, 255, 1, 255),
    ("PILOT_THR_FILT", _F32, 0, 0, 10, "Hz"),
    ("PILOT_TKOFF_ALT", _F32, 0, 0, 1000, "cm"),
    ("PILOT_THR_BHV", _I16, 0, 0, 7),
    ("PILOT_SPEED_UP", _I16, 250, 50, 500, "cm/s"),
    ("PILOT_SPEED_DN", _I16, 0, 0, 500, "cm/s"),
    ("PILOT_ACCEL_Z", _I16, 250, 50, 500, "cm/s/s"),
    ("FS_GCS_ENABLE", _I8, 0, 0, 7),
    ("FS_GCS_TIMEOUT", _F32, 5, 2, 120, "s"),
    ("FS_THR_ENABLE", _I8, 1, 0, 7),
    ("FS_THR_VALUE", _I16, 975, 910, 1100, "PWM"),
    ("FS_EKF_ACTION", _I8, 1, 0, 3),
    ("FS_EKF_THRESH", _F32, 0.8, 0, 1),
    ("FS_CRASH_CHECK", _I8, 1, 0, 1),
    ("FS_VIBE_ENABLE", _I8, 1, 0, 1),
    ("FS_OPTIONS", _I32, 16, 0, 255),
    ("FS_DR_ENABLE", _I8, 2, 0, 6),
    ("FS_DR_TIMEOUT", _I16, 30, 0, 120, "s"),
    ("GPS_HDOP_GOOD", _I16, 140, 100, 900),
    ("SUPER_SIMPLE", _I8, 0, 0, 63),
    ("SIMPLE", _I8, 0, 0, 63),
    ("WP_YAW_BEHAVIOR", _I8, 2, 0, 3),
    ("RTL_ALT", _I32, 1500, 30, 300000, "cm"),
    ("RTL_CONE_SLOPE", _F32, 3, 0, 10),
    ("RTL_SPEED", _I16, 0, 0, 2000, "cm/s"),
    ("RTL_ALT_FINAL", _I16, 0, 0, 1000, "cm"),
    ("RTL_CLIMB_MIN", _I16, 0, 0, 3000, "cm"),
    ("RTL_LOIT_TIME", _I32, 5000, 0, 60000, "ms"),
    ("RTL_ALT_TYPE", _I8, 0, 0, 1),
    ("RTL_OPTIONS", _I32, 0),
    ("LAND_SPEED", _I16, 50, 30, 200, "cm/s"),
    ("LAND_SPEED_HIGH", _I16, 0, 0, 500, "cm/s"),
    ("LAND_ALT_LOW", _I16, 1000, 100, 10000, "cm"),
    ("LAND_REPOSITION", _I8, 1, 0, 1),
    *((f"FLTMODE{k}", _I8, 0, 0, 40) for k in range(1, 7)),
    ("FLTMODE_CH", _I8, 5, 0, 16),
    ("INITIAL_MODE", _I8, 0, 0, 40),
    ("LOG_BITMASK", _I32, 176126),
    ("ESC_CALIBRATION", _I8, 0, 0, 9),
    ("TUNE", _I8, 0),
    ("TUNE_MIN", _F32, 0),
    ("TUNE_MAX", _F32, 0),
    ("FRAME_TYPE", _I8, 1),
    ("DISARM_DELAY", _I8, 10, 0, 127, "s"),
    ("ANGLE_MAX", _I16, 3000, 1000, 8000, "cdeg"),
    ("PHLD_BRAKE_RATE", _I16, 8, 4, 12, "deg/s"),
    ("PHLD_BRAKE_ANGLE", _I16, 3000, 2000, 4500, "cdeg"),
    ("ACRO_BAL_ROLL", _F32, 1, 0, 3),
    ("ACRO_BAL_PITCH", _F32, 1, 0, 3),
    ("ACRO_TRAINER", _I8, 2, 0, 2),
    ("ACRO_RP_RATE", _F32, 360, 1, 1080, "deg/s"),
    ("ACRO_Y_RATE", _F32, 202.5, 1, 360, "deg/s"),
    ("PILOT_Y_RATE", _F32, 202.5, 1, 360, "deg/s"),
    ("PILOT_Y_EXPO", _F32, 0, -0.5, 1),
    ("GUID_TIMEOUT", _F32, 3, 0.1, 5, "s"),
    ("GUID_OPTIONS", _I32, 0),
    ("AUTO_OPTIONS", _I32, 0),
    ("FLIGHT_OPTIONS", _I32, 0),
    ("RC_SPEED", _I16, 490, 50, 490, "Hz"),
    ("ARMING_CHECK", _I32, 1),
    ("ARMING_REQUIRE", _I8, 1, 0, 3),
    ("ARMING_RUDDER", _I8, 2, 0, 2),
    ("WPNAV_SPEED", _F32, 1000, 10, 2000, "cm/s"),
    ("WPNAV_RADIUS", _F32, 200, 5, 1000, "cm"),
    ("WPNAV_SPEED_UP", _F32, 250, 10, 1000, "cm/s"),
    ("WPNAV_SPEED_DN", _F32, 150, 10, 500, "cm/s"),
    ("WPNAV_ACCEL", _F32, 250, 50, 500, "cm/s/s"),
    ("WPNAV_ACCEL_Z", _F32, 100, 50, 500, "cm/s/s"),
    ("WPNAV_RFND_USE", _I8, 1, 0, 1),
    ("WPNAV_JERK", _F32, 1, 1, 20, "m/s/s/s"),
    ("WPNAV_TER_MARGIN", _F32, 10, 0.1, math.inf, "m"),
    ("LOIT_ANG_MAX", _F32, 0, 0, 45, "deg"),
    ("LOIT_SPEED", _F32, 1250, 20, 3500, "cm/s"),
    ("LOIT_ACC_MAX", _F32, 500, 100, 981, "cm/s/s"),
    ("LOIT_BRK_ACCEL", _F32, 250, 25, 250, "cm/s/s"),
    ("LOIT_BRK_JERK", _F32, 500, 500, 5000, "cm/s/s/s"),
    ("LOIT_BRK_DELAY", _F32, 1, 0, 2, "s"),
    ("CIRCLE_RADIUS", _F32, 1000, 0, 200000, "cm"),
    ("CIRCLE_RATE", _F32, 20, -90, 90, "deg/s"),
    ("ATC_SLEW_YAW", _F32, 6000, 500, 18000, "cdeg/s"),
    ("ATC_ACCEL_Y_MAX", _F32, 27000, 0, 72000, "cdeg/s/s"),
    ("ATC_ACCEL_R_MAX", _F32, 110000, 0, 180000, "cdeg/s/s"),
    ("ATC_ACCEL_P_MAX", _F32, 110000, 0, 180000, "cdeg/s/s"),
    ("ATC_RATE_FF_ENAB", _I8, 1, 0, 1),
    *((f"ATC_ANG_{axis}_P", _F32, 4.5, 3, 12) for axis in ("RLL", "PIT", "YAW")),
    *(
        (f"ATC_RAT_{axis}_{gain}", _F32, value)
        for axis in ("RLL", "PIT")
        for gain, value in (("P", 0.135), ("I", 0.135), ("D", 0.0036))
    ),
    ("ATC_RAT_YAW_P", _F32, 0.18),
    ("ATC_RAT_YAW_I", _F32, 0.018),
    ("ATC_RAT_YAW_D", _F32, 0),
    ("ATC_INPUT_TC", _F32, 0.15, 0, 1, "s"),
    ("PSC_POSZ_P", _F32, 1, 1, 3),
    ("PSC_VELZ_P", _F32, 5, 1, 8),
    # With 0 the firmware does not filter; here it is refused.
    ("PSC_VELZ_FLTE", _F32, 5, 0.1, 100, "Hz"),
    ("PSC_ACCZ_P", _F32, 0.5, 0.2, 1.5),
    ("PSC_ACCZ_I", _F32, 1, 0, 3),
    ("PSC_ACCZ_FLTE", _F32, 20, 1, 100, "Hz"),
    ("PSC_POSXY_P", _F32, 1, 0.5, 2),
    ("PSC_VELXY_P", _F32, 2, 0.1, 6),
    ("PSC_VELXY_I", _F32, 1, 0.02, 1),
    ("PSC_VELXY_D", _F32, 0.25, 0, 1),
    ("PSC_ANGLE_MAX", _F32, 0, 0, 45, "deg"),
    ("PSC_JERK_XY", _F32, 5, 1, 20, "m/s/s/s"),
    ("PSC_JERK_Z", _F32, 5, 5, 50, "m/s/s/s"),
    ("MOT_SPIN_ARM", _F32, 0.1, 0, 0.3),
    ("MOT_SPIN_MIN", _F32, 0.15, 0, 0.3),
    ("MOT_SPIN_MAX", _F32, 0.95, 0.9, 1),
    ("MOT_THST_EXPO", _F32, 0.65, -1, 1),
    ("MOT_THST_HOVER", _F32, 0.35, 0.125, 0.6875),
    ("MOT_HOVER_LEARN", _I8, 2, 0, 2),
    ("MOT_PWM_TYPE", _I8, 0),
    ("MOT_PWM_MIN", _I16, 1000, 0, 2000, "PWM"),
    ("MOT_PWM_MAX", _I16, 2000, 0, 2000, "PWM"),
    ("MOT_BAT_VOLT_MAX", _F32, 0, 0, math.inf, "V"),
    ("MOT_BAT_VOLT_MIN", _F32, 0, 0, 42, "V"),
    ("MOT_SPOOL_TIME", _F32, 0.5, 0, 2, "s"),
    ("MOT_YAW_HEADROOM", _I16, 200, 0, 500, "PWM"),
    ("BATT_MONITOR", _I8, 4),
    ("BATT_CAPACITY", _I32, 3300, 0, math.inf, "mAh"),
    ("BATT_SERIAL_NUM", _I32, -1),
    ("BATT_LOW_TIMER", _I8, 10, 0, 120, "s"),
    ("BATT_FS_VOLTSRC", _I8, 0, 0, 1),
    ("BATT_LOW_VOLT", _F32, 10.5, 0, math.inf, "V"),
    ("BATT_LOW_MAH", _F32, 0, 0, math.inf, "mAh"),
    ("BATT_CRT_VOLT", _F32, 0, 0, math.inf, "V"),
    ("BATT_CRT_MAH", _F32, 0, 0, math.inf, "mAh"),
    ("BATT_FS_LOW_ACT", _I8, 0, 0, 7),
    ("BATT_FS_CRT_ACT", _I8, 0, 0, 7),
    ("BATT_ARM_VOLT", _F32, 0, 0, math.inf, "V"),
    ("BATT_ARM_MAH", _I32, 0, 0, math.inf, "mAh"),
    ("FENCE_ENABLE", _I8, 0, 0, 1),
    ("FENCE_TYPE", _I8, 7, 0, 15),
    ("FENCE_ACTION", _I8, 1, 0, 5),
    ("FENCE_ALT_MAX", _F32, 100, 10, 1000, "m"),
    ("FENCE_ALT_MIN", _F32, -10, -100, 100, "m"),
    ("FENCE_RADIUS", _F32, 300, 30, 10000, "m"),
    ("FENCE_MARGIN", _F32, 2, 1, 10, "m"),
    ("FOLL_ENABLE", _I8, 0, 0, 1),
    ("FOLL_SYSID", _I16, 0, 0, 255),
    ("FOLL_DIST_MAX", _F32, 100, 1, 1000, "m"),
    ("FOLL_OFS_TYPE", _I8, 0, 0, 1),
    ("FOLL_OFS_X", _F32, 0, -100, 100, "m"),
    ("FOLL_OFS_Y", _F32, 0, -100, 100, "m"),
    ("FOLL_OFS_Z", _F32, 0, -100, 100, "m"),
    ("FOLL_YAW_BEHAVE", _I8, 1, 0, 3),
    ("FOLL_POS_P", _F32, 0.1, 0.01, 1),
    ("FOLL_ALT_TYPE", _I8, 1, 0, 1),
    ("RALLY_LIMIT_KM", _F32, 0.3, 0, math.inf, "km"),
    ("RALLY_INCL_HOME", _I8, 1, 0, 1),
    ("MIS_RESTART", _I8, 0, 0, 1),
    ("MIS_OPTIONS", _I16, 0),
    ("AVOID_ENABLE", _I8, 3, 0, 7),
    ("AVOID_MARGIN", _F32, 2, 1, 10, "m"),
    ("TERRAIN_ENABLE", _I8, 1, 0, 1),
    ("TERRAIN_SPACING", _I16, 100, 0, math.inf, "m"),
    ("AHRS_EKF_TYPE", _I8, 3),
    ("AHRS_ORIENTATION", _I8, 0),
    ("AHRS_TRIM_X", _F32, 0, -0.1745, 0.1745, "rad"),
    ("AHRS_TRIM_Y", _F32, 0, -0.1745, 0.1745, "rad"),
    ("EK2_ENABLE", _I8, 0, 0, 1),
    ("EK3_ENABLE", _I8, 1, 0, 1),
    ("EK3_SRC1_POSXY", _I8, 3),
    ("EK3_SRC1_VELXY", _I8, 3),
    ("EK3_SRC1_POSZ", _I8, 1),
    ("EK3_SRC1_VELZ", _I8, 3),
    ("EK3_SRC1_YAW", _I8, 1),
    ("GPS1_TYPE", _I8, 1),
    ("GPS_AUTO_SWITCH", _I8, 1),
    ("GPS_PRIMARY", _I8, 0),
    ("COMPASS_ENABLE", _I8, 1, 0, 1),
    ("COMPASS_USE", _I8, 1, 0, 1),
    ("COMPASS_AUTODEC", _I8, 1, 0, 1),
    ("COMPASS_LEARN", _I8, 0, 0, 3),
    ("COMPASS_DEC", _F32, 0, -3.142, 3.142, "rad"),
    ("INS_GYRO_FILTER", _I16, 20, 0, 256, "Hz"),
    ("INS_ACCEL_FILTER", _I16, 20, 0, 256, "Hz"),
    ("SCHED_LOOP_RATE", _I16, 400, 50, 2000, "Hz"),
    ("LOG_BACKEND_TYPE", _I8, 1, 0, 7),
    ("LOG_DISARMED", _I8, 0, 0, 3),
    ("LOG_REPLAY", _I8, 0, 0, 1),
    ("SERIAL0_BAUD", _I32, 115),
    ("SERIAL0_PROTOCOL", _I8, 2),
    ("SERIAL1_BAUD", _I32, 57),
    ("SERIAL1_PROTOCOL", _I8, 2),
    *((f"SR0_{group}", _I16, 0, 0, 50, "Hz") for group in STREAMS),
    ("SR0_PARAMS", _I16, 10, 0, 50, "Hz"),
    ("RCMAP_ROLL", _I8, 1, 1, 16),
    ("RCMAP_PITCH", _I8, 2, 1, 16),
    ("RCMAP_THROTTLE", _I8, 3, 1, 16),
    ("RCMAP_YAW", _I8, 4, 1, 16),
    *(row for k in range(1, 9) for row in _channel(k)),
    ("STAT_BOOTCNT", _I16, 0),
    ("STAT_FLTTIME", _I32, 0, 0, math.inf, "s"),
    ("STAT_RUNTIME", _I32, 0, 0, math.inf, "s"),
    ("STAT_RESET", _I32, 1),
)


def table(rotors: int) -> tuple[Parameter, ...]:
    """Return the parameters of a vehicle with ``rotors`` rotors."""
    vehicle: tuple[_Row, ...] = (
        ("FRAME_CLASS", _I8, _CLASSES.get(rotors, 0), 0, 17),
        *(row for k in range(1, 9) for row in _output(k, rotors)),
    )
    return tuple(Parameter(*row)._replace(bound=BOUND.get(row[0])) for row in (*_ROWS, *vehicle))
