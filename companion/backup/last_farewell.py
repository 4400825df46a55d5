"""Farewell of a companion that has ended, which its backup node says in its place."""

from __future__ import annotations

from companion.avoidance.certified.committed import carried_on
from companion.config.certified import CertifiedConfig
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Entry, Statement, in_messages
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.plan import PAYLOAD_TYPE as PLAN
from mavlink_bridge.wire.plan import WirePlan
from mavlink_bridge.wire.plan import pack as pack_plan


class LastFarewell:
    """Farewell that answers all whose plans were received; its sender is ``own``.

    ``fingerprint``: that of the fleet's settings.
    """

    def __init__(self, own: Source, config: CertifiedConfig, fingerprint: int) -> None:
        self._own, self._config, self._fingerprint = own, config, fingerprint
        self._since = 0
        self._entries: dict[int, Entry] = {}

    def receive(self, statement: Statement) -> None:
        """Receive a statement of the companion: the entries of its last beginning count."""
        if statement.since > self._since:
            self._since = statement.since
            self._entries.clear()
        self._entries.update((entry.peer, entry) for entry in statement.entries)

    def hear(self, system: int, plan: WirePlan) -> None:
        """Take note of a ``plan`` of another vehicle, received after the companion's end."""
        entry = self._entries.get(system, Entry(system))
        if plan.epoch > entry.considered[1]:
            self._entries[system] = entry._replace(considered=(entry.considered[0], plan.epoch))

    def messages(self, now: int, plan: WirePlan) -> list[Message]:
        """Return ``plan``, the newest, and the statement that it is the last one.

        Nothing before it has begun at ``now`` (µs) by the clocks of all. The plan is carried on, because old
        plans are not accepted; the entries are the last ones of the companion, by which the others know that
        this farewell answers their own beginning, and name the newest plans that ``hear`` was given.
        """
        begun = now - 2 * self._config.clock_us
        if begun < plan.epoch:
            return []
        plan = carried_on(plan, (begun - plan.epoch) // self._config.epoch_us * self._config.knots)
        entries = tuple(entry._replace(agreements=()) for _, entry in sorted(self._entries.items()))
        statement = Statement(self._fingerprint, plan.epoch, self._since, entries, farewell=True)
        return [
            Tunnel(self._own, 0, 0, PLAN, pack_plan(plan)),
            *(Tunnel(self._own, 0, 0, AGREEMENTS, pack_statement(part)) for part in in_messages(statement)),
        ]
