"""Tables of the page. All external text in the tables is escaped here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape

from outrider.report.events import Event
from outrider.report.glossary import HIDDEN, TERMS, Term
from outrider.report.headline import Fact
from outrider.report.loss import Losses, LossRate
from outrider.report.run import Gap

MOST_EVENTS = 2000
_LEVELS = (0.0, 0.01, 0.05, 0.1, 0.2, 0.4, 0.7)
"""Shares of loss at which the shading of a cell increases."""
_SILENCES = (0.0, 0.3, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Times without a message (s) at which the shading of a cell increases."""


def summary_table(summary: Mapping[str, object]) -> str:
    """Return the table of the summary: keys of the glossary first, in its order, then all others.

    Hidden keys and keys without a value are omitted.
    """
    keys = [key for key in TERMS if key in summary]
    keys += [key for key in summary if key not in TERMS and key not in HIDDEN]
    rows = []
    for key in keys:
        term, value = TERMS.get(key, Term(key, "", "")), summary[key]
        if value is None or (isinstance(value, Mapping) and set(value.values()) <= {None}):
            continue
        unit = f" {term.unit}" if term.unit else ""
        rows.append(
            f"<tr><th scope=row>{escape(term.words)}</th><td>{escape(_value(value))}{escape(unit)}</td>"
            f"<td class=meaning>{escape(term.meaning)}</td></tr>"
        )
    return f"<table class=summary><tbody>{''.join(rows)}</tbody></table>"


def fact_list(facts: Sequence[Fact]) -> str:
    """Return the list of key figures at the top of the page."""
    items = "".join(
        f"<div><dt>{escape(fact.what)}</dt><dd>{escape(fact.value)}<small>{escape(fact.against)}</small></dd></div>"
        for fact in facts
    )
    return f"<dl class=facts>{items}</dl>"


def gap_list(gaps: Sequence[Gap]) -> str:
    """Return the list of missing or damaged parts; empty if there are none."""
    if not gaps:
        return ""
    items = "".join(f"<li><code>{escape(gap.what)}</code> {escape(gap.why)}</li>" for gap in gaps)
    return f"<section class=gaps><h2>Missing or damaged</h2><ul>{items}</ul></section>"


def event_table(events: Sequence[Event]) -> str:
    """Return the table of events; each row has a button that moves the replay to its time."""
    if not events:
        return "<p>None is known.</p>"
    rows = []
    for event in events[:MOST_EVENTS]:
        until = "" if event.until is None or event.until <= event.time else f" – {event.until:.2f}"
        who = ", ".join(map(str, event.who))
        rows.append(
            f"<tr{' class=bad' if event.bad else ''}><td><button type=button data-time={event.time:.3f}>"
            f"{event.time:.2f}{until}</button></td><td>{escape(event.kind)}</td><td>{escape(who)}</td>"
            f"<td>{escape(event.text)}</td></tr>"
        )
    more = len(events) - MOST_EVENTS
    rest = f"<p>… and {more} more.</p>" if more > 0 else ""
    head = "<thead><tr><th>s</th><th>what</th><th>who</th><th></th></tr></thead>"
    return f"<div class=scroll><table class=events>{head}<tbody>{''.join(rows)}</tbody></table></div>{rest}"


def loss_tables(losses: Losses) -> str:
    """Return tables of losses and of longest silences, senders in rows, receivers in columns."""
    ways = {(way.sender, way.receiver): way for way in losses.ways}
    if not ways:
        return "<p>No log has messages of the swarm link.</p>"
    shares = _matrix(ways, "lost, %", _share_cell)
    silences = _matrix(ways, "longest silence after the goal event, s", _silence_cell)
    guessed = any(not way.exact for way in losses.ways)
    note = "<p class=note>≈ from gaps in the sequence numbers: the sender has no log.</p>" if guessed else ""
    return f"<div class=matrices>{shares}{silences}</div>{note}"


def _matrix(ways: Mapping[tuple[int, int], LossRate], title: str, cell: Callable[[LossRate], str]) -> str:
    senders = sorted({sender for sender, _ in ways})
    receivers = sorted({receiver for _, receiver in ways})
    head = "".join(f"<th scope=col>{receiver}</th>" for receiver in receivers)
    rows = []
    for sender in senders:
        cells = (
            "<td class=none></td>" if (way := ways.get((sender, receiver))) is None else cell(way)
            for receiver in receivers
        )
        rows.append(f"<tr><th scope=row>{sender}</th>{''.join(cells)}</tr>")
    corner = "<th class=axes>from ↓ to →</th>"
    return (
        f"<figure class=matrix><figcaption>{escape(title)}</figcaption><div class=scroll><table><thead>"
        f"<tr>{corner}{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></figure>"
    )


def _share_cell(way: LossRate) -> str:
    about = "" if way.exact else "≈"
    sent = f"{way.sender} to {way.receiver}: {about}{way.lost} of {way.sent} messages did not arrive"
    return _cell(f"{about}{100.0 * way.share:.1f}", _level(way.share, _LEVELS), sent)


def _silence_cell(way: LossRate) -> str:
    if way.silence is None:
        return _cell("–", 0, f"{way.sender} to {way.receiver}: nothing was heard")
    usual = "" if way.usual is None else f"; 95 % of the messages came within {way.usual:.2f} s of the last"
    sent = f"{way.sender} to {way.receiver}: {way.silence:.2f} s without a message{usual}"
    return _cell(f"{way.silence:.2f}", _level(way.silence, _SILENCES), sent)


def _cell(text: str, level: int, sent: str) -> str:
    return f'<td class=l{level} title="{escape(sent)}">{escape(text)}</td>'


def _level(value: float, bounds: Iterable[float]) -> int:
    return sum(value > bound for bound in bounds)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        parts = (f"{name} {_value(part)}" for name, part in value.items() if part is not None)
        return ", ".join(parts) or "–"
    return str(value)
