"""Armed state and flight mode, and their changes by commands, ground contact and time.

The commander decides; the guidance flies.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from pymavlink.dialects.v20 import all as mavlink

from sitl.autopilot.autonomous_modes import MODES, AutonomousModes
from sitl.autopilot.firmware import CommandRefusal, Firmware, Mode, Status
from sitl.autopilot.guidance import Activity, Guidance
from sitl.autopilot.missions.itinerary import Event
from sitl.autopilot.setpoint_reception import SetpointReception
from sitl.config.autopilot import AutopilotConfig
from sitl.estimation.sensors import Estimate
from sitl.telemetry.status_text import StatusReporter
from sitl.values.home import Home

# Sink speed of PX4's position mode without sticks (m/s).
_DESCENT_SPEED: Final = 0.6
# Modes that failsafes enter, by severity; failsafes enter no other modes.
_SEVERITY: Final = {Mode.HOLD: 1, Mode.RETURN: 2, Mode.LAND: 3}


class Commander:
    """Armed state and flight mode of one vehicle.

    A command method returns None if its request is executed or already fulfilled, or else the refusal.
    ``doubts`` returns the objections to arming that do not depend on the mode.
    """

    def __init__(
        self,
        config: AutopilotConfig,
        flavour: Firmware,
        guidance: Guidance,
        steering: SetpointReception,
        estimate: Callable[[], Estimate],
        home: Home,
        autonomous_modes: AutonomousModes,
        status_text: StatusReporter,
    ) -> None:
        """``estimate`` returns the present estimate."""
        self._config = config
        self._flavour = flavour
        self._guidance = guidance
        self._steering = steering
        self._estimate = estimate
        self._home = home
        self._autonomous_modes = autonomous_modes
        self._status_text = status_text
        self._takeoff_height = config.takeoff_height
        self._ready_at = 0 if config.start_height else round(config.ready_after * 1e6)
        self._contact_since: int | None = None
        self._unlocated_since: int | None = None
        self._disarm_at = 0
        self._disarm_delay = round(config.disarm_delay * 1e6)
        self._chosen_mode = flavour.boot_mode
        self._setpoints_lost = False
        self.doubts: Callable[[], list[str]] = list
        self.armed = False
        self.landed = True
        self.ready = False
        self.mode = flavour.boot_mode

    def configure(self, config: AutopilotConfig) -> None:
        """Use new settings from now on."""
        if config.takeoff_height != self._config.takeoff_height:
            self._takeoff_height = config.takeoff_height
        self._config = config
        self._disarm_delay = round(config.disarm_delay * 1e6)

    @property
    def chosen_mode(self) -> Mode:
        """Mode that was chosen last."""
        return self._chosen_mode

    def status(self, now: int) -> Status:
        """Return the inputs of decisions at ``now`` (µs)."""
        stream = self._steering.stream
        return Status(
            self.armed,
            self.landed,
            self.ready,
            self.mode,
            -self._estimate().position[2] - self._home.height,
            self._guidance.activity is Activity.TAKEOFF,
            stream.age(now),
            stream.gap,
        )

    def begin_in_air(self) -> None:
        """Boot in flight: armed, at rest, holding."""
        self.armed, self.landed = True, False
        self.mode = self._flavour.after_takeoff
        self._guidance.hover(self._estimate().pose)

    # Requests

    def arm(self, now: int, *, forced: bool) -> CommandRefusal | None:
        """Allow the motors to turn. ``forced`` overrides every objection."""
        if self.armed:
            return None
        if not forced:
            if not self.ready:
                return CommandRefusal(
                    mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "Arming refused: no position yet"
                )
            reason = self._flavour.arming_refusal(self.status(now))
            if doubts := [reason] if reason else self.doubts():
                return CommandRefusal(mavlink.MAV_RESULT_FAILED, f"Arming refused: {doubts[0]}")
        self.armed = True
        self._restart_disarm_timer(now)
        self._status_text.inform("Armed")
        if self.mode is Mode.MISSION:
            self._autonomous_modes.begin(self.mode, self._estimate())
        if self.mode is Mode.TAKEOFF:
            self._guidance.takeoff(self._takeoff_height + self._home.height, self._estimate().pose)
        return None

    def disarm(self, *, forced: bool) -> CommandRefusal | None:
        """Stop the motors; in flight only if ``forced``, and then the vehicle falls."""
        if self.armed and not self.landed and not forced:
            return CommandRefusal(mavlink.MAV_RESULT_FAILED, "Disarming refused: flying")
        if self.armed:
            self._stop("Disarmed")
        return None

    def cut(self, why: str) -> None:
        """Stop the motors in any state."""
        if self.armed:
            self._stop(why)

    def fail_safe(self, mode: Mode, now: int) -> None:
        """Change to ``mode`` as a failsafe.

        The call has no effect while the vehicle is disarmed, on the ground, or in a mode at least as severe.
        Without a position the vehicle enters LAND instead.
        """
        if not self.armed or self.landed or _SEVERITY.get(mode, 0) <= _SEVERITY.get(self.mode, 0):
            return
        self._switch(mode if self.ready else Mode.LAND, now)

    @property
    def level_speed(self) -> float:
        """Default horizontal speed (m/s)."""
        return self._config.waypoint_speed

    def take_off(self, altitude: float, relative: bool | None, now: int) -> CommandRefusal | None:
        """Execute NAV_TAKEOFF (22); the arguments are those of ``Firmware.takeoff``."""
        verdict = self._flavour.takeoff(altitude, relative, self._home.altitude, self.status(now))
        if isinstance(verdict, CommandRefusal):
            return verdict
        self.mode, self._takeoff_height = verdict.mode, verdict.height
        self._setpoints_lost = False
        if self.armed:
            self._restart_disarm_timer(now)
            self._guidance.takeoff(verdict.height + self._home.height, self._estimate().pose)
        return None

    def enter(self, mode: Mode, now: int) -> CommandRefusal | None:
        """Change to ``mode``."""
        if mode is self.mode:
            self._setpoints_lost = False
            return None
        status = self.status(now)
        if mode is Mode.MISSION:
            itinerary = self._autonomous_modes.itinerary
            status = status._replace(items=itinerary.total, takes_off=itinerary.takes_off)
        if refusal := self._flavour.mode_refusal(mode, status):
            return refusal
        self._setpoints_lost = False
        self._switch(mode, now)
        if not self.armed or self._flavour.armable_mode(mode):
            self._chosen_mode = mode
        return None

    def mode_doubt(self, now: int) -> str | None:
        """Return the objection to arming in the present mode at ``now`` (µs).

        Return None if armed, or if the firmware's pre-arm check does not include the mode.
        """
        if self.armed or not self._flavour.checks_mode:
            return None
        return self._flavour.arming_refusal(self.status(now))

    @property
    def follows(self) -> bool:
        """Whether the vehicle follows a leader."""
        return self.armed and not self.landed and self.mode is Mode.FOLLOW

    def steered(self, now: int) -> None:
        """Handle a usable set-point: PX4 resumes OFFBOARD if only a lack of set-points had ended it."""
        if self._setpoints_lost and self.armed:
            self._switch(Mode.GUIDED, now)

    # Events

    def watch(self, now: int, on_ground: bool, located: bool) -> None:
        """Handle the effects of time and ground contact until ``now`` (µs).

        ``located``: the estimator has a position.
        """
        self.ready = located and now >= self._ready_at
        if not on_ground:
            self.landed = False
            self._contact_since = None
        elif not self.landed:
            self._confirm_landing(now)
        if not self.armed:
            return
        guidance = self._guidance
        if not located or self._unlocated_since is not None:
            self._watch_position(now, located)
        if guidance.timed_out:
            self._handle_timeout(now)
        elif self.mode in MODES:
            self._autonomous_step(now)
        elif guidance.activity is Activity.TAKEOFF and guidance.reached:
            self.mode = self._chosen_mode = self._flavour.after_takeoff
            guidance.end_takeoff()
        if not self.landed:
            self._restart_disarm_timer(now)
        elif now >= self._disarm_at:
            self._stop("Disarmed: on the ground for too long")

    def start_mission(self, now: int) -> CommandRefusal | None:
        """Execute MISSION_START (300): enter the mission mode, and arm if this firmware does."""
        refusal = self.enter(Mode.MISSION, now)
        if refusal is None and self._flavour.start_arms:
            return self.arm(now, forced=False)
        return refusal

    def _autonomous_step(self, now: int) -> None:
        event = self._autonomous_modes.advance(self.mode, now, self._estimate())
        if event is Event.RETURNS:
            self._switch(Mode.RETURN, now)
        elif event is Event.FINISHED:
            self._status_text.inform("Mission finished")
            self.mode = self._chosen_mode = self._flavour.after_mission
            self._guidance.hold()

    def _switch(self, mode: Mode, now: int) -> None:
        self.mode = mode
        self._setpoints_lost = False
        if self.armed and mode is Mode.MISSION:
            self._autonomous_modes.begin(mode, self._estimate())
            return
        if self.landed or not self.armed:
            self._guidance.idle()
            if self.armed and mode is Mode.LAND:
                self._stop("Landed, disarmed")
            elif mode is Mode.LAND:
                self.mode = self._flavour.after_landing
            return
        match mode:
            case Mode.LAND:
                self._guidance.land(self._config.land_speed)
            case Mode.RETURN | Mode.FOLLOW:
                self._autonomous_modes.begin(mode, self._estimate())
            case Mode.GUIDED:
                self._steering.resume(self._estimate().pose, now)
            case _:
                self._guidance.hold()

    def _handle_timeout(self, now: int) -> None:
        self._guidance.timed_out = False
        self._status_text.warn("Set-points timed out")
        if self._flavour.after_loss is not self.mode:
            self._switch(self._flavour.after_loss, now)
            self._setpoints_lost = self._flavour.keeps_choice
        if self.mode is Mode.POSITION:
            self._guidance.land(_DESCENT_SPEED)

    def _watch_position(self, now: int, located: bool) -> None:
        """Land, from any mode, if the position stays lost in flight."""
        if located or self.landed:
            self._unlocated_since = None
            return
        if self._unlocated_since is None:
            self._unlocated_since = now
        if (
            self.mode is not Mode.LAND
            and now - self._unlocated_since >= self._flavour.position_loss_timeout_us
        ):
            self._status_text.warn(self._flavour.blind_text)
            self._switch(Mode.LAND, now)

    def _confirm_landing(self, now: int) -> None:
        """Handle ground contact, except during a takeoff; after ``touchdown_time`` the vehicle has landed."""
        activity = self._guidance.activity
        if activity is Activity.TAKEOFF:
            return
        if activity is Activity.LAND:
            # Thrust is cut at once, so that the vehicle does not bounce until the landing is confirmed.
            self._guidance.idle()
        if self._contact_since is None:
            self._contact_since = now
        if now - self._contact_since < self._config.touchdown_time * 1e6:
            return
        self.landed = True
        self._restart_disarm_timer(now)
        if self.armed and self._guidance.activity is Activity.IDLE:
            self._stop("Landed, disarmed")
        self._guidance.idle()

    def _stop(self, why: str) -> None:
        self.armed = False
        self._guidance.idle()
        self._autonomous_modes.end()
        if self._flavour.keeps_choice:
            self.mode = self._chosen_mode
        elif self.mode is Mode.LAND:
            self.mode = self._flavour.after_landing
        elif self.mode is Mode.RETURN:
            self.mode = self._flavour.after_return
        elif self.mode is Mode.MISSION:
            self.mode = self._flavour.after_mission
        elif self.mode is Mode.TAKEOFF:
            self.mode = self._flavour.after_takeoff
        self._status_text.inform(why)

    def _restart_disarm_timer(self, now: int) -> None:
        self._disarm_at = now + self._disarm_delay
