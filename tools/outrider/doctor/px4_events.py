"""PX4's reasons against arming, from EVENT messages (410).

PX4 1.16 sends STATUSTEXT only over links on which it receives a ground station's heartbeat, but EVENT over
every link. If the mode is the reason, only an EVENT reports it. pymavlink's dialects have no EVENT, so it is
decoded here. An event's id is the low 24 bits of the FNV-1a hash of the event's name.
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import all as mavlink

from mavlink_bridge.wire.framing import Frame
from outrider.logs.flight_modes import mode_name

EVENT: Final = 410
CRC_EXTRA: Final = b"\xa0"
LAYOUT: Final = Struct("<IIHBBBI")
"""Id, boot time (ms), sequence, destination, log levels, and the first argument of a check.

That argument holds the modes that the check concerns, one bit for each navigation state.
"""
_WARNING: Final = 4
_OFFSET, _PRIME = 0x811C9DC5, 0x01000193

_CHECKS: Final = {
    "check_modes_angular_velocity": "no angular velocity",
    "check_modes_attitude": "no attitude estimate",
    "check_modes_local_pos": "no local position estimate",
    "check_modes_global_pos": "no global position estimate",
    "check_modes_local_alt": "no altitude estimate",
    "check_modes_mission": "no valid mission",
    "check_modes_offboard_signal": "no offboard signal",
    "check_modes_home_position": "home is not set",
    "check_modes_manual_control": "no manual control",
    "check_modes_cannot_takeoff": "this mode cannot be armed in",
    "check_external_modes_unavailable": "its external mode is not registered",
    "check_accel_missing": "an accelerometer is missing",
    "check_accel_no_data": "an accelerometer gives no data",
    "check_accel_not_calibrated": "an accelerometer is not calibrated",
    "check_gyro_missing": "a gyro is missing",
    "check_gyro_no_data": "a gyro gives no data",
    "check_gyro_not_calibrated": "a gyro is not calibrated",
    "check_imu_accel_inconsistent": "the accelerometers disagree",
    "check_imu_gyro_inconsistent": "the gyros disagree",
    "check_mag_missing": "a compass is missing",
    "check_mag_no_data": "a compass gives no data",
    "check_mag_not_calibrated": "a compass is not calibrated",
    "check_mag_consistency": "the compasses disagree",
    "check_mag_fault": "a compass has a fault",
    "check_mag_sys_has_mag_missing": "fewer compasses than SYS_HAS_MAG asks for",
    "check_baro_missing": "a barometer is missing",
    "check_baro_no_data": "a barometer gives no data",
    "check_battery_missing": "a battery is missing",
    "check_battery_disconnected": "a battery is disconnected",
    "check_battery_unhealthy": "the battery is unhealthy",
    "check_battery_fault": "the battery has a fault",
    "check_battery_low": "the battery is low",
    "check_battery_critical": "the battery is critical",
    "check_battery_emergency": "the battery is all but empty",
    "check_avionics_power_missing": "the power module is not connected",
    "check_avionics_power_low": "the avionics' voltage is low",
    "check_missing_system_power": "the system's power is not known",
    "check_cpuload_too_high": "the CPU load is too high",
    "check_ram_usage_too_high": "the memory is all but full",
    "check_missing_cpuload": "CPU and memory load are not known",
    "check_missing_fmu_sdcard": "there is no SD card",
    "check_hardfault_present": "crash dumps are on the SD card",
    "check_estimator_missing_data": "the estimator is starting",
    "check_estimator_heading_not_stable": "the heading estimate is not stable",
    "check_estimator_hgt_not_stable": "the height estimate is not stable",
    "check_estimator_hor_pos_not_stable": "the horizontal position is not stable",
    "check_estimator_hor_vel_not_stable": "the horizontal velocity is not stable",
    "check_estimator_vert_vel_not_stable": "the vertical velocity is not stable",
    "check_estimator_high_accel_bias": "the accelerometers' bias is high",
    "check_estimator_high_gyro_bias": "the gyros' bias is high",
    "check_estimator_mag_interference": "strong magnetic interference",
    "check_estimator_low_position_accuracy": "the position estimate is not accurate",
    "check_estimator_gps_fix_too_low": "the GPS fix is too poor",
    "check_estimator_gps_not_fusing": "the estimator does not use GPS",
    "check_estimator_gps_num_sats_too_low": "too few GPS satellites",
    "check_estimator_gps_generic": "GPS is too poor",
    "check_system_no_global_pos": "a global position is required",
    "check_system_no_home_pos": "home is required",
    "check_system_safety_button": "the safety button was not pressed",
    "check_system_usb_connected": "USB is connected",
    "check_system_flight_term_active": "flight termination is active",
    "check_system_arm_auth_failed": "arming was not authorized",
    "check_rc_dl_no_dllink": "no ground station",
    "check_man_control_kill_engaged": "the kill switch is engaged",
    "check_man_control_rtl_engaged": "the return switch is engaged",
    "check_failure_detector_roll": "it leans too far (roll)",
    "check_failure_detector_pitch": "it leans too far (pitch)",
    "check_failure_detector_arm_esc": "a motor controller has failed",
    "check_failure_detector_motor": "a motor has failed",
    "check_escs_offline": "a motor controller is offline",
    "check_escs_telem_missing": "the motor controllers send no telemetry",
    "check_gf_no_home": "its fence needs home",
    "check_gf_violation_custom_gf": "it is outside its fence",
    "check_gf_violation_max_hor_dist": "it is outside its fence",
    "check_gf_violation_max_alt": "it is above its fence",
}
# Navigation states by mode.
_STATES: Final = {
    "MANUAL": 0,
    "ALTCTL": 1,
    "POSCTL": 2,
    "AUTO TAKEOFF": 17,
    "AUTO HOLD": 4,
    "AUTO MISSION": 3,
    "AUTO RETURN": 5,
    "AUTO LAND": 18,
    "AUTO FOLLOW": 19,
    "AUTO PRECLAND": 20,
    "OFFBOARD": 14,
    "STABILIZED": 15,
}


def event_id(name: str) -> int:
    """Return the low 24 bits of the id of an event; the high 8 bits are the component."""
    value = _OFFSET
    for byte in name.encode():
        value = ((value ^ byte) * _PRIME) & 0xFFFFFFFF
    return value & 0xFFFFFF


_WORDS: Final = {event_id(name): words for name, words in _CHECKS.items()}


def genuine(frame: Frame) -> bool:
    """Return whether ``frame`` is an EVENT with a correct checksum."""
    if frame.message_id != EVENT or frame.version != 2:
        return False
    end = len(frame.data) - 2 - (mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if frame.signed else 0)
    return mcrf4xx(frame.data[1:end] + CRC_EXTRA) == int.from_bytes(frame.data[end : end + 2], "little")


def reason(frame: Frame, custom_mode: int) -> str | None:
    """Return the reason in an EVENT against arming in mode ``custom_mode``.

    None for other frames, unknown events, events less severe than a warning, and events that do not concern
    this mode.
    """
    if not genuine(frame):
        return None
    payload = frame.payload.ljust(LAYOUT.size, b"\0")
    number, _, _, _, _, levels, modes = LAYOUT.unpack_from(payload)
    state = _STATES.get(mode_name("px4", custom_mode))
    concerned = state is None or modes >> state & 1
    return _WORDS.get(number & 0xFFFFFF) if concerned and levels & 0xF <= _WARNING else None
