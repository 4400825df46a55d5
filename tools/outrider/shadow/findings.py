"""Results of a shadow run, as numbers for scripts and as files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from mavlink_bridge.tlog.log import TlogReport
from outrider.shadow.picture import draw
from outrider.shadow.setpoints import apart, course, facts
from outrider.shadow.shadow_run import ShadowRun

_COLUMNS = (
    *("who", "time_us", "north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s"),
    *("a_north_m_s2", "a_east_m_s2", "a_down_m_s2", "yaw_rad", "mask", "frame"),
)


def document_of(found: ShadowRun) -> dict[str, object]:
    """Return the results for scripts.

    They describe the set-points that would have been sent and, under ``sent``, those that were sent;
    ``apart_m`` has the 50th and 95th percentiles of the distance between the two. ``damaged_records`` counts
    as ``damaged_records`` does.
    """
    would, sent = facts(found.would), facts(found.sent)
    off = apart(course(found.would), course(found.sent))
    document: dict[str, object] = dict(would._asdict())
    document["holds"] = found.holds
    document["reasons"] = dict(found.reasons)
    document["records"] = found.records
    document["damaged_records"] = found.damaged
    document["sent"] = sent._asdict()
    document["apart_m"] = {
        f"p{q}": round(float(np.percentile(off, q)), 3) if len(off) else None for q in (50, 95)
    }
    return document


def damaged_records(report: TlogReport, used: int) -> int:
    """Return how many records of a log are damaged, after a pass that has used ``used`` of them.

    They are records with a wrong checksum, records whose stamp is no time, and stretches of bytes that are no
    record, of which each counts once, however many records have been there. A frame with a right checksum and
    without a possible stamp counts, and is used where the reader has a time for it.
    """
    return report.bad + report.truncated + max(report.good - used, 0)


def damage(name: str, found: ShadowRun) -> str:
    """Return a line about the damaged records of the log ``name``, or an empty string."""
    if not found.damaged:
        return ""
    places = "1 place" if found.damaged == 1 else f"{found.damaged} places"
    return (
        f"{name}: damaged at {places} (a wrong checksum, bytes that are no record, or a stamp that is no"
        " time); frames with a right checksum are used where a time is known for them"
    )


def leave(directory: Path, name: str, found: ShadowRun, document: dict[str, object]) -> None:
    """Write ``setpoints.csv``, ``replay.json`` and ``replay.png`` to ``directory``."""
    (directory / "replay.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    with (directory / "setpoints.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(_COLUMNS)
        for who, told in (("would", found.would), ("sent", found.sent)):
            rows.writerows(
                (who, t, *m.position, *m.velocity, *m.acceleration, m.yaw, m.type_mask, m.frame)
                for t, m in told
            )
    draw(name, found, directory / "replay.png")
