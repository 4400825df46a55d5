"""Parameters of PX4 1.16 that clients look for, with the firmware's types, defaults and units.

The table holds about a quarter of a multicopter's parameters, sorted by name as in PX4. Most have no effect
here; those with a ``Bound`` are settings of the simulation. The module is long because it is a table.
"""

from __future__ import annotations

import math
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from sitl.autopilot.parameters.parameter import Bound, Kind, Parameter
from sitl.telemetry.reports import TYPES

_I, _F = Kind.INT32, Kind.REAL32
_Row = (
    tuple[str, Kind, float]
    | tuple[str, Kind, float, float, float]
    | tuple[str, Kind, float, float, float, str]
)
_AIRFRAMES: Final = {4: 4001, 6: 6001, 8: 8001}
"""SYS_AUTOSTART of the generic airframes by the number of rotors."""

BOUND: Final = {
    "MAV_SYS_ID": Bound("system_id"),
    "COM_OF_LOSS_T": Bound("offboard_timeout"),
    "COM_OBL_RC_ACT": Bound(
        "offboard_loss", options=((0, "descend"), (3, "return"), (4, "land"), (5, "hold"))
    ),
    "COM_DISARM_PRFLT": Bound("disarm_delay"),
    "MIS_TAKEOFF_ALT": Bound("takeoff_height"),
    "MPC_TKO_SPEED": Bound("takeoff_speed"),
    "MPC_LAND_SPEED": Bound("land_speed"),
    "MPC_XY_CRUISE": Bound("waypoint_speed"),
    "MPC_Z_V_AUTO_UP": Bound("waypoint_climb"),
    "MPC_Z_V_AUTO_DN": Bound("waypoint_sink"),
    "MPC_XY_VEL_MAX": Bound("px4.speed"),
    "MPC_XY_P": Bound("px4.position"),
    "MPC_XY_VEL_P_ACC": Bound("px4.velocity"),
    "MPC_XY_VEL_I_ACC": Bound("px4.integral"),
    "MPC_XY_VEL_D_ACC": Bound("px4.derivative"),
    "MPC_TILTMAX_AIR": Bound("px4.tilt", math.radians(1.0)),
    "MPC_Z_VEL_MAX_UP": Bound("px4.speed_up"),
    "MPC_Z_VEL_MAX_DN": Bound("px4.speed_down"),
    "MPC_Z_P": Bound("px4.position_z"),
    "MPC_Z_VEL_P_ACC": Bound("px4.velocity_z"),
    "MPC_Z_VEL_I_ACC": Bound("px4.integral_z"),
    "NAV_ACC_RAD": Bound("acceptance_radius"),
    "RTL_RETURN_ALT": Bound("return_height"),
    "RTL_LAND_DELAY": Bound("return_pause"),
    "BAT_LOW_THR": Bound("battery_failsafe.low"),
    "BAT_CRIT_THR": Bound("battery_failsafe.critical"),
    "BAT_EMERGEN_THR": Bound("battery_failsafe.emergency"),
    "COM_LOW_BAT_ACT": Bound("battery_failsafe.action", options=((0, "warn"), (2, "land"), (3, "return"))),
    "GF_MAX_VER_DIST": Bound("fence.height"),
    "GF_MAX_HOR_DIST": Bound("fence.radius"),
    "GF_ACTION": Bound(
        "fence.action",
        options=((0, "nothing"), (1, "warn"), (2, "hold"), (3, "return"), (4, "terminate"), (5, "land")),
    ),
    "FLW_TGT_DST": Bound("follow.distance"),
    "FLW_TGT_FA": Bound("follow.angle"),
    "FLW_TGT_HT": Bound("follow.height"),
    "SYS_FAILURE_EN": Bound("failures", options=((0, "refused"), (1, "obeyed"))),
}

_ROWS: Final[tuple[_Row, ...]] = (
    ("BAT1_CAPACITY", _F, -1, -1, 100000, "mAh"),
    ("BAT1_N_CELLS", _I, 4, 0, 16),
    ("BAT1_SOURCE", _I, 0, -1, 2),
    ("BAT1_V_CHARGED", _F, 4.05, 0, math.inf, "V"),
    ("BAT1_V_EMPTY", _F, 3.6, 0, math.inf, "V"),
    ("BAT_CRIT_THR", _F, 0.07, 0.05, 0.5),
    ("BAT_EMERGEN_THR", _F, 0.05, 0.03, 0.5),
    ("BAT_LOW_THR", _F, 0.15, 0.12, 0.5),
    ("CAL_ACC0_ID", _I, 1310988),
    ("CAL_ACC0_PRIO", _I, 50, -1, 100),
    ("CAL_GYRO0_ID", _I, 1310988),
    ("CAL_GYRO0_PRIO", _I, 50, -1, 100),
    ("CAL_MAG0_ID", _I, 197388),
    ("CAL_MAG0_PRIO", _I, 50, -1, 100),
    ("CAL_MAG0_ROT", _I, 0, -1, 40),
    ("CA_AIRFRAME", _I, 0, 0, 14),
    ("CBRK_FLIGHTTERM", _I, 121212, 0, 121212),
    ("CBRK_SUPPLY_CHK", _I, 0, 0, 894281),
    ("COM_ARM_WO_GPS", _I, 1, 0, 2),
    ("COM_DISARM_LAND", _F, 2, -1, 20, "s"),
    ("COM_DISARM_PRFLT", _F, 10, 0, 3600, "s"),
    ("COM_DL_LOSS_T", _I, 10, 5, 300, "s"),
    ("COM_FAIL_ACT_T", _F, 5, 0, 25, "s"),
    *((f"COM_FLTMODE{k}", _I, -1, -1, 120) for k in range(1, 7)),
    ("COM_FLT_TIME_MAX", _I, -1, -1, math.inf, "s"),
    ("COM_HOME_EN", _I, 1, 0, 1),
    ("COM_LOW_BAT_ACT", _I, 0, 0, 3),
    ("COM_OBL_RC_ACT", _I, 0, 0, 7),
    ("COM_OF_LOSS_T", _F, 1, 0, 60, "s"),
    ("COM_POS_FS_EPH", _F, 5, -1, 400, "m"),
    ("COM_RCL_EXCEPT", _I, 0, 0, 31),
    ("COM_RC_IN_MODE", _I, 1, 0, 8),
    ("COM_RC_LOSS_T", _F, 0.5, 0, 35, "s"),
    ("COM_TAKEOFF_ACT", _I, 0, 0, 1),
    ("COM_WIND_WARN", _F, -1, -1, 30, "m/s"),
    ("EKF2_BARO_CTRL", _I, 1, 0, 1),
    ("EKF2_EN", _I, 1, 0, 1),
    ("EKF2_GPS_CTRL", _I, 7, 0, 15),
    ("EKF2_GPS_DELAY", _F, 110, 0, 300, "ms"),
    ("EKF2_GPS_P_GATE", _F, 5, 1, math.inf, "SD"),
    ("EKF2_GPS_V_GATE", _F, 5, 1, math.inf, "SD"),
    ("EKF2_HGT_REF", _I, 1, 0, 3),
    ("EKF2_MAG_TYPE", _I, 0, 0, 6),
    ("EKF2_NOAID_TOUT", _I, 5000000, 500000, 10000000, "us"),
    ("EKF2_REQ_EPH", _F, 3, 2, 100, "m"),
    ("EKF2_REQ_EPV", _F, 5, 2, 100, "m"),
    ("EKF2_REQ_NSATS", _I, 6, 4, 12),
    ("FLW_TGT_ALT_M", _I, 0, 0, 2),
    ("FLW_TGT_DST", _F, 8, 1, math.inf, "m"),
    ("FLW_TGT_FA", _F, 180, -180, 180),
    ("FLW_TGT_HT", _F, 8, 8, math.inf, "m"),
    ("FLW_TGT_MAX_VEL", _F, 5, 0, 20, "m/s"),
    ("FLW_TGT_RS", _F, 0.1, 0, 1),
    ("GF_ACTION", _I, 2, 0, 5),
    ("GF_MAX_HOR_DIST", _F, 0, 0, 10000, "m"),
    ("GF_MAX_VER_DIST", _F, 0, 0, 10000, "m"),
    ("GF_PREDICT", _I, 0, 0, 1),
    ("GF_SOURCE", _I, 0, 0, 1),
    ("LNDMC_ROT_MAX", _F, 20, 0, math.inf, "deg/s"),
    ("LNDMC_XY_VEL_MAX", _F, 1.5, 0, math.inf, "m/s"),
    ("LNDMC_Z_VEL_MAX", _F, 0.25, 0, math.inf, "m/s"),
    ("MAV_COMP_ID", _I, 1, 1, 250),
    ("MAV_PROTO_VER", _I, 0, 0, 2),
    ("MAV_SYS_ID", _I, 1, 1, 250),
    ("MC_AIRMODE", _I, 0, 0, 2),
    *((f"MC_{axis}_P", _F, 6.5, 0, 12) for axis in ("PITCH", "ROLL")),
    *(
        (f"MC_{axis}RATE_{gain}", _F, value, 0, high)
        for axis in ("PITCH", "ROLL")
        for gain, value, high in (
            ("D", 0.003, 0.01),
            ("I", 0.2, 10),
            ("K", 1, 10),
            ("MAX", 220, 1800),
            ("P", 0.15, 0.6),
        )
    ),
    ("MC_YAWRATE_D", _F, 0, 0, math.inf),
    ("MC_YAWRATE_I", _F, 0.1, 0, math.inf),
    ("MC_YAWRATE_MAX", _F, 200, 0, 1800, "deg/s"),
    ("MC_YAWRATE_P", _F, 0.2, 0, 0.6),
    ("MC_YAW_P", _F, 2.8, 0, 5),
    ("MIS_DIST_1WP", _F, 10000, -1, 100000, "m"),
    ("MIS_TAKEOFF_ALT", _F, 2.5, 0.1, 80, "m"),
    ("MIS_TKO_LAND_REQ", _I, 0, 0, 5),
    ("MIS_YAW_ERR", _F, 12, 0, 90, "deg"),
    ("MIS_YAW_TMT", _F, -1, -1, 20, "s"),
    ("MPC_ACC_DOWN_MAX", _F, 3, 2, 15, "m/s^2"),
    ("MPC_ACC_HOR", _F, 3, 2, 15, "m/s^2"),
    ("MPC_ACC_HOR_MAX", _F, 5, 2, 15, "m/s^2"),
    ("MPC_ACC_UP_MAX", _F, 4, 2, 15, "m/s^2"),
    ("MPC_JERK_AUTO", _F, 4, 1, 80, "m/s^3"),
    ("MPC_JERK_MAX", _F, 8, 0.5, 500, "m/s^3"),
    ("MPC_LAND_ALT1", _F, 10, 0, 122, "m"),
    ("MPC_LAND_ALT2", _F, 5, 0, 122, "m"),
    ("MPC_LAND_ALT3", _F, 1, 0, 122, "m"),
    ("MPC_LAND_CRWL", _F, 0.3, 0.1, 10, "m/s"),
    ("MPC_LAND_SPEED", _F, 0.7, 0.3, 10, "m/s"),
    ("MPC_MANTHR_MIN", _F, 0.08, 0, 1),
    ("MPC_MAN_TILT_MAX", _F, 35, 0, 90, "deg"),
    ("MPC_MAN_Y_MAX", _F, 150, 0, 400, "deg/s"),
    ("MPC_THR_HOVER", _F, 0.5, 0.1, 0.8),
    ("MPC_THR_MAX", _F, 1, 0, 1),
    ("MPC_THR_MIN", _F, 0.12, 0.05, 0.5),
    ("MPC_TILTMAX_AIR", _F, 45, 20, 89, "deg"),
    ("MPC_TILTMAX_LND", _F, 12, 10, 89, "deg"),
    ("MPC_TKO_RAMP_T", _F, 3, 0, 5),
    ("MPC_TKO_SPEED", _F, 1.5, 0.3, 5, "m/s"),
    ("MPC_USE_HTE", _I, 1, 0, 1),
    ("MPC_VEL_MANUAL", _F, 10, 3, 20, "m/s"),
    ("MPC_XY_CRUISE", _F, 5, 0.5, 20, "m/s"),
    ("MPC_XY_P", _F, 0.95, 0, 2),
    ("MPC_XY_VEL_D_ACC", _F, 0.2, 0.1, 2),
    ("MPC_XY_VEL_I_ACC", _F, 0.4, 0, 60),
    ("MPC_XY_VEL_MAX", _F, 12, 0, 20, "m/s"),
    ("MPC_XY_VEL_P_ACC", _F, 1.8, 1.2, 5),
    ("MPC_YAW_MODE", _I, 0, 0, 4),
    ("MPC_Z_P", _F, 1, 0.1, 1.5),
    ("MPC_Z_VEL_D_ACC", _F, 0, 0, 2),
    ("MPC_Z_VEL_I_ACC", _F, 2, 0.2, 3),
    ("MPC_Z_VEL_MAX_DN", _F, 1.5, 0.5, 4, "m/s"),
    ("MPC_Z_VEL_MAX_UP", _F, 3, 0.5, 8, "m/s"),
    ("MPC_Z_VEL_P_ACC", _F, 4, 2, 15),
    ("MPC_Z_V_AUTO_DN", _F, 1.5, 0.5, 4, "m/s"),
    ("MPC_Z_V_AUTO_UP", _F, 3, 0.5, 8, "m/s"),
    ("NAV_ACC_RAD", _F, 10, 0.05, 200, "m"),
    ("NAV_DLL_ACT", _I, 0, 0, 6),
    ("NAV_LOITER_RAD", _F, 80, -10000, 10000, "m"),
    ("NAV_MC_ALT_RAD", _F, 0.8, 0.05, 200, "m"),
    ("NAV_RCL_ACT", _I, 2, 1, 6),
    *(
        row
        for k in range(1, 9)
        for row in (
            (f"RC{k}_DZ", _F, 10, 0, 100, "us"),
            (f"RC{k}_MAX", _F, 2000, 1500, 2200, "us"),
            (f"RC{k}_MIN", _F, 1000, 800, 1500, "us"),
            (f"RC{k}_REV", _F, 1, -1, 1),
            (f"RC{k}_TRIM", _F, 1500, 800, 2200, "us"),
        )
    ),
    ("RC_CHAN_CNT", _I, 0, 0, 18),
    *(
        (f"RC_MAP_{what}", _I, 0, 0, 18)
        for what in (
            "FLTMODE",
            "KILL_SW",
            "LOITER_SW",
            "OFFB_SW",
            "PITCH",
            "RETURN_SW",
            "ROLL",
            "THROTTLE",
            "YAW",
        )
    ),
    ("RTL_CONE_ANG", _I, 45, 0, 90, "deg"),
    ("RTL_DESCEND_ALT", _F, 30, 0, math.inf, "m"),
    ("RTL_LAND_DELAY", _F, 0, -1, math.inf, "s"),
    ("RTL_MIN_DIST", _F, 10, 0.5, math.inf, "m"),
    ("RTL_RETURN_ALT", _F, 60, 0, math.inf, "m"),
    ("RTL_TYPE", _I, 0, 0, 5),
    ("SDLOG_MODE", _I, 0, -1, 4),
    ("SDLOG_PROFILE", _I, 1, 0, 4095),
    ("SENS_BOARD_ROT", _I, 0, -1, 40),
    ("SIM_BAT_DRAIN", _F, 60, 1, 86400, "s"),
    ("SYS_AUTOCONFIG", _I, 0, 0, 1),
    ("SYS_FAILURE_EN", _I, 0, 0, 1),
    ("SYS_HAS_BARO", _I, 1, 0, 1),
    ("SYS_HAS_GPS", _I, 1, 0, 1),
    ("SYS_HAS_MAG", _I, 1, 0, 3),
)


def table(rotors: int) -> tuple[Parameter, ...]:
    """Return the parameters of a vehicle with ``rotors`` rotors."""
    kind, airframe = TYPES.get(rotors, mavlink.MAV_TYPE_GENERIC), _AIRFRAMES.get(rotors, 0)
    vehicle: tuple[_Row, ...] = (
        ("CA_ROTOR_COUNT", _I, rotors, 0, 12),
        ("MAV_TYPE", _I, kind, 0, 22),
        ("SYS_AUTOSTART", _I, airframe, 0, 9999999),
    )
    rows = sorted((*_ROWS, *vehicle))
    return tuple(Parameter(*row)._replace(bound=BOUND.get(row[0])) for row in rows)
