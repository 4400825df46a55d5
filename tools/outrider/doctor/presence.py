"""Senders on the link, and the case that there is none."""

from __future__ import annotations

from collections.abc import Iterator

from pymavlink.dialects.v20 import all as mavlink

from companion.values.components import COMPONENT
from outrider.doctor.case import Case
from outrider.doctor.finding import Finding, Severity
from outrider.doctor.hearing import MOST, SETPOINTS, Hearing
from outrider.doctor.sender_record import SenderRecord
from outrider.logs.words import enumerated


def nobody(hearing: Hearing, system: int | None, log: bool) -> Finding:
    """Return the reason why there is no vehicle to examine."""
    severity = Severity.BLOCKING
    if not hearing.frames:
        if hearing.refused:
            return Finding(
                f"{hearing.refused} frames arrive, and none counts: {hearing.refusal}",
                severity,
                "With --key the doctor accepts only new frames that are signed with this key.",
                "Give the vehicle the same key (docs/signing.md), or leave --key out; see that the "
                "clocks are right.",
            )
        if hearing.skipped_bytes:
            return Finding(
                f"{hearing.skipped_bytes} bytes arrive, and no MAVLink among them",
                severity,
                "Nothing can be read.",
                "Set the baud rate of the endpoint to that of the autopilot's port (SERIALn_BAUD, "
                "SER_TEL1_BAUD), and the port's protocol to MAVLink 2 (SERIALn_PROTOCOL = 2, MAV_n_CONFIG).",
            )
        if hearing.failure:
            return Finding(
                f"no connection: {hearing.failure}",
                severity,
                "No program accepts connections at this address.",
                "Start the autopilot, simulator or router first, and compare host and port: "
                "tcp:127.0.0.1:5760 for ArduPilot's SITL. A sender of UDP needs udpin:HOST:PORT here.",
            )
        return Finding(
            f"nothing arrives in {hearing.seconds:.0f} s",
            severity,
            "There is no vehicle to examine.",
            "See that the autopilot runs, and that it sends to this endpoint: udpin:127.0.0.1:14540 for "
            "PX4's offboard link, tcp:127.0.0.1:5760 for ArduPilot's SITL, /dev/DEVICE,BAUD for a serial "
            "port; that nobody else has it open; and that TX and RX are crossed.",
        )
    present = sorted({one.source.system for one in hearing.autopilots})
    if system is not None and present:
        return Finding(
            f"system {system} is not there; here are {listed(present)}",
            severity,
            "No vehicle obeys commands to an id that none has.",
            f"Use --system {present[0]}, or set the vehicle's id to {system} (SYSID_THISMAV; MAV_SYS_ID "
            "with PX4).",
        )
    others = ", ".join(f"{one.source.system}/{one.source.component}" for one in hearing.senders.values())
    return Finding(
        f"no autopilot's HEARTBEAT; only {others[:80]} can be heard",
        severity,
        "Without it neither mode nor firmware is known, and nothing may be sent.",
        "The log has none of an autopilot: record the autopilot's own link."
        if log
        else "See that the router passes the autopilot's messages on to this endpoint.",
    )


def company(case: Case) -> Iterator[Finding]:
    """Yield findings on other senders on the link."""
    others = [one for one in case.hearing.autopilots if one is not case.vehicle]
    systems = sorted({one.source.system for one in others} - {case.vehicle.source.system})
    if systems:
        yield Finding(
            f"{len(systems)} more vehicles on this link: systems {listed(systems)}"
            if len(systems) > 1
            else f"another vehicle on this link: system {systems[0]}",
            Severity.NOTE if case.log else Severity.WARNING,
            f"All of this is about system {case.vehicle.source.system}. A companion commands one vehicle "
            "by its id; on a link of several a wrong id commands another.",
            "Give each companion a link of its own, or be sure of its system id (--system ID examines "
            "another).",
        )
    for sender in case.hearing.senders.values():
        if sender is not case.vehicle and sender.source != case.me:
            yield from _about(case, sender)
    if case.hearing.unreceived:
        yield Finding(
            f"more than {MOST} senders",
            Severity.WARNING,
            "A node floods the link, or invents senders.",
            "Find out which nodes can send there; sign the link (docs/signing.md).",
        )


def _about(case: Case, sender: SenderRecord) -> Iterator[Finding]:
    system, component = sender.source
    own = system == case.vehicle.source.system
    name = f"{system}/{component}"
    steers = sum(stream.count for number, stream in sender.streams.items() if number in SETPOINTS)
    if steers:
        yield Finding(
            f"{name} sends set-points ({steers})",
            Severity.NOTE if case.log else Severity.BLOCKING,
            "The recorded flight was steered by it."
            if case.log
            else "With two senders of set-points the vehicle jumps between their set-points.",
            "" if case.log else f"End the program that speaks as {name} before an escort begins.",
        )
    elif own and component == COMPONENT:
        yield Finding(
            f"a companion is at work already ({name})",
            Severity.NOTE if case.log else Severity.WARNING,
            "Other vehicles cannot tell a second one with the same id from it.",
            "" if case.log else "Use it, or end it before starting another.",
        )
    elif sender.is_ground_station:
        yield Finding(
            f"a ground station: {name}",
            Severity.NOTE,
            "It may take the vehicle over at any time, and keeps it then.",
        )
    elif sender.heartbeat is not None and sender.heartbeat.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
        kind = (enumerated("MAV_TYPE", sender.heartbeat.type) or "").removeprefix("MAV_TYPE_").lower()
        yield Finding(
            f"another component: {name}, {kind.replace('_', ' ')}", Severity.NOTE, "It has no effect."
        )


def listed(numbers: list[int]) -> str:
    """Return the numbers with commas, at most twelve of them."""
    return ", ".join(map(str, numbers[:12])) + (" …" if len(numbers) > 12 else "")
