"""Tables of a census."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

from rich.console import Console
from rich.table import Table
from rich.text import Text

from outrider.logs.census import Census, Vehicle
from outrider.logs.words import MILLION, kind, rates

MOST_SHOWN, MOST_BESIDE = 30, 12
"""Maximum numbers of rows and of systems in the table of rates; JSON has all."""


_FILE_WIDTH = 400
"""Number of columns where output is no terminal."""


def show(name: str, census: Census) -> None:
    """Print the log as tables: the log as a whole, its systems, and the rate of each message."""
    console = Console()
    if not console.is_terminal:
        # In a file or a pipe nothing is cut: who reads it may have any width.
        console = Console(width=_FILE_WIDTH)
    # Above the table, where a long name is not broken.
    console.print(Text(name), soft_wrap=True)
    for table in (_whole(census), _people(census)):
        console.print(table)
    loudest = sorted(census.vehicles, key=lambda vehicle: -vehicle.messages)[:MOST_BESIDE]
    shown = sorted(loudest, key=lambda vehicle: vehicle.system)
    names = _names(shown)
    console.print(_often(shown, names[:MOST_SHOWN]))
    left_out = (len(names) - MOST_SHOWN, "messages"), (len(census.vehicles) - MOST_BESIDE, "systems")
    for number, what in left_out:
        if number > 0:
            console.print(Text(f"and {number} rarer {what}; --json has all"))


def _whole(census: Census) -> Table:
    report = census.report
    records = report.good + report.bad + report.unknown
    table = Table(show_header=False)
    rows = {
        "begins": _date(census.start),
        "length, s": f"{(census.end - census.start) / MILLION:.1f}",
        "good records": str(report.good),
        "bad": f"{report.bad} ({report.bad / records:.1%})",
        "of unknown messages": str(report.unknown),
        "bytes skipped": str(report.skipped_bytes),
        "ends within a record": "yes" if report.truncated else "no",
        "time steps back": str(report.time_steps_back),
        "signed": f"{census.signed} messages" if census.signed else "no",
    }
    for words, value in rows.items():
        table.add_row(words, value)
    return table


def _people(census: Census) -> Table:
    table = Table()
    for column in ("system", "components", "what", "MAVLink", "links", "messages", "from – to, s", "gaps"):
        table.add_column(column, overflow="fold")
    for vehicle in census.vehicles:
        times = [(time - census.start) / MILLION for time in (vehicle.first, vehicle.last)]
        table.add_row(
            str(vehicle.system),
            _listed(vehicle.components),
            kind(vehicle),
            _listed(vehicle.versions) + (", signed" if vehicle.signed else ""),
            _listed(vehicle.links),
            str(vehicle.messages),
            f"{times[0]:.1f} – {times[1]:.1f}",
            _breaks(vehicle),
        )
    return table


def _breaks(vehicle: Vehicle) -> str:
    limit, number, longest = vehicle.gaps
    if not number:
        return "none"
    return f"{number} over {limit / MILLION:.1f} s, longest {longest / MILLION:.1f}"


def _often(vehicles: Sequence[Vehicle], names: Sequence[str]) -> Table:
    """Return the table of rates: a row for each message, a column for each system."""
    table = Table(title="messages per second")
    table.add_column("", no_wrap=True, min_width=max(map(len, names), default=0))
    for vehicle in vehicles:
        table.add_column(str(vehicle.system), justify="right", no_wrap=True)
    columns = [rates(vehicle) for vehicle in vehicles]
    for name in names:
        table.add_row(name, *(f"{hz[name]:.3g}" if name in hz else "" for hz in columns))
    return table


def _names(vehicles: Sequence[Vehicle]) -> list[str]:
    """Return the names of all messages, in the order of their highest rate."""
    best: dict[str, float] = {}
    for vehicle in vehicles:
        for name, rate in rates(vehicle).items():
            best[name] = max(best.get(name, 0.0), rate)
    return sorted(best, key=lambda name: (-best[name], name))


def _listed(numbers: tuple[int, ...]) -> str:
    return ", ".join(map(str, numbers))


def _date(time: int) -> str:
    """Return a time (µs) as text; the number itself where no calendar has it."""
    try:
        return f"{datetime.fromtimestamp(time // MILLION, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (OverflowError, ValueError, OSError):
        return f"{time} µs"
