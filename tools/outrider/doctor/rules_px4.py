"""Rules for PX4's parameters that affect an escort."""

from __future__ import annotations

from typing import Final

from outrider.doctor.case import Case
from outrider.doctor.rule import BLOCKING, NOTE, OK, WARNING, Meaning, Rule, fence, low_battery, number


def _loss_action(value: float, _case: Case) -> Meaning:
    said = {
        0: Meaning(
            WARNING,
            "When set-points stop it changes to Position mode and, without a pilot, sinks at 0.6 m/s: "
            "its default.",
            "Set COM_OBL_RC_ACT to 5 (hold).",
        ),
        3: Meaning(
            NOTE,
            "When set-points stop it returns home, across whatever is between.",
            "5 (hold) keeps it clear of others.",
        ),
        4: Meaning(NOTE, "When set-points stop it lands where it is.", "5 (hold) keeps it clear of others."),
        5: Meaning(OK, "When set-points stop it holds, after 3 to 4 m of drift from 2 m/s."),
    }
    if value in said:
        return said[int(value)]
    if value in (1, 2):
        return Meaning(
            WARNING, "When set-points stop it goes to a mode that a pilot has to fly.", "Set it to 5 (hold)."
        )
    if value in (6, 7):
        return Meaning(
            BLOCKING, "When set-points stop it stops its motors in the air.", "Set it to 5 (hold)."
        )
    return Meaning(WARNING, "The doctor does not know this value.", "Set it to 5 (hold).")


def _loss_time(value: float, _case: Case) -> Meaning:
    if value < 0.3:
        return Meaning(WARNING, "A short break of the link ends OFFBOARD.", "Set COM_OF_LOSS_T to 1 s.")
    if value > 2.0:
        return Meaning(
            WARNING,
            f"It follows the last set-point for {value:g} s after the stream stops.",
            "Set COM_OF_LOSS_T to 1 s.",
        )
    return Meaning(OK, f"OFFBOARD ends {value:g} s after the last set-point.")


def _remote_lost(value: float, _case: Case) -> Meaning:
    if int(value) & 4:
        return Meaning(OK, "OFFBOARD goes on without remote control.")
    return Meaning(
        NOTE,
        "If a remote control was connected and is lost, NAV_RCL_ACT ends OFFBOARD.",
        "COM_RCL_EXCEPT with bit 2 (value 4) keeps OFFBOARD; leave it if a pilot stands by.",
    )


def _failures(value: float, _case: Case) -> Meaning:
    if value == 0:
        return Meaning(OK, "Nobody can make its sensors or motors fail by a command.")
    return Meaning(
        WARNING, "A command can make its sensors and motors fail, as tests do.", "Set SYS_FAILURE_EN to 0."
    )


def _ground_lost(value: float, _case: Case) -> Meaning:
    if value == 0:
        return Meaning(NOTE, "It flies on when the ground station is lost.")
    return Meaning(
        NOTE,
        "When the ground station is lost the autopilot acts by itself (hold 1, return 2, land 3, …).",
        "See that a ground station stays connected, or set NAV_DLL_ACT to 0.",
    )


def _own_jerk(value: float, _case: Case) -> Meaning:
    if value < 4.0:
        return Meaning(
            WARNING,
            f"Its own modes, such as HOLD when set-points stop, change acceleration by {value:g} m/s³ at "
            "most, stock by 4: it drifts further.",
            "Set MPC_JERK_AUTO to 4.",
        )
    return Meaning(OK, "How fast its own modes change acceleration, m/s³: not lower than stock.")


PX4_RULES: Final = (
    Rule("COM_OBL_RC_ACT", _loss_action, "Its default, 0, sinks at 0.6 m/s when set-points stop; 5 holds."),
    Rule("COM_OF_LOSS_T", _loss_time, "How long it follows after the last set-point: 1 s by default."),
    Rule("COM_RCL_EXCEPT", _remote_lost, "Whether losing the remote control ends OFFBOARD."),
    Rule("NAV_DLL_ACT", _ground_lost, "What it does when the ground station is lost."),
    Rule("COM_LOW_BAT_ACT", low_battery, "What it does when the battery is low."),
    Rule("GF_ACTION", fence, "What it does at its fence."),
    Rule("SYS_FAILURE_EN", _failures, "Whether failures can be injected."),
    Rule("MPC_JERK_AUTO", _own_jerk, "How fast its own modes change acceleration: 4 m/s³ by default."),
    Rule("MAV_SYS_ID", number, "Its id after the next start."),
)
"""Rules in the order in which they are reported."""
