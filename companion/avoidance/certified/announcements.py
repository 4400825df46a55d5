"""What a vehicle tells of its plan and agreements: when it is due, repeated, and recalled."""

from __future__ import annotations

from companion.avoidance.certified.agreements import Agreements
from companion.avoidance.certified.commitment import Commitment, HoldReason
from companion.avoidance.certified.repetition import EPOCHS, Repetition
from companion.avoidance.certified.reservation import Reservation
from companion.avoidance.certified.told_goals import ToldGoals
from companion.config.certified import CertifiedConfig
from mavlink_bridge.messages import Message, Source, Tunnel
from mavlink_bridge.wire.agreements import PAYLOAD_TYPE as AGREEMENTS
from mavlink_bridge.wire.agreements import Statement, in_messages
from mavlink_bridge.wire.agreements import pack as pack_statement
from mavlink_bridge.wire.plan import PAYLOAD_TYPE, WirePlan, pack


class Announcements:
    """Announcements of one vehicle's plans, with statements of its agreements."""

    def __init__(
        self,
        own: Source,
        config: CertifiedConfig,
        commitment: Commitment,
        agreements: Agreements,
        reservation: Reservation,
        told: ToldGoals,
    ) -> None:
        self._own, self._repeat_us, self._told = own, config.repeat_us, told
        self._commitment, self._agreements, self._reservation = commitment, agreements, reservation
        self._repetition = Repetition(config)
        self.next_at = 0
        """Time (µs) of the next repetition."""
        self._announced = self._participated = False
        self._unsent: int | None = None
        self._turn = 0

    def begin(self) -> bool:
        """Note that a new plan begins, which is unannounced; return whether the one before was announced."""
        announced, self._announced = self._announced, False
        return announced

    def messages(self, now: int, announced: WirePlan, outside: float, *, farewell: bool) -> list[Message]:
        """Return the plan ``announced`` with a statement of all agreements, or one of those that changed.

        The plan is due at once and then every ``repeat_us``, or more often in heavy loss (``Repetition``).
        ``outside`` (m): how far the vehicle is outside its tube. ``farewell``: the vehicle makes no further
        plan, and the statement says so.
        """
        self._unsent = None
        new = announced.epoch != self._commitment.announced_until
        if not new and now < self.next_at:
            return [] if farewell else self._statements(announced.epoch, outside, every=False)
        if new:
            self._repetition.update(now, self._agreements.peers.received(now, EPOCHS))
            self._unsent = self._commitment.announced_until
        self._commitment.announced_until = announced.epoch
        self.next_at = now + self._repetition.period
        self._announced, self._participated = True, not farewell
        if farewell:
            self._agreements.leave(announced.epoch)
        statements = self._statements(announced.epoch, outside, every=True, farewell=farewell)
        tunnels = [
            Tunnel(self._own, 0, 0, PAYLOAD_TYPE, pack(plan)) for plan in (announced, *self._repeated())
        ]
        return [*tunnels, *statements, *self._told.messages()]

    def away(self, now: int) -> list[Message]:
        """Return the statement that another controller flies the vehicle, if plans were announced before."""
        self._unsent = None
        if not self._participated or now < self.next_at:
            return []
        self.next_at = now + self._repeat_us
        epoch = max(self._commitment.epoch(now), self._commitment.announced_until)
        statement = Statement(self._agreements.fingerprint, epoch, self._agreements.since, away=True)
        return [Tunnel(self._own, 0, 0, AGREEMENTS, pack_statement(statement))]

    def recall(self) -> bool:
        """Carry the plan on in place of the one that the last ``messages`` announced for the first time.

        Call it if these messages are not sent. Returns False, and changes nothing, for a plan with which the
        vehicle begins anew, for a farewell, and for a plan in space that was a column. The last two go on
        with the plan before; after an anchor the vehicle is beside its new plan until it has followed.
        """
        commitment, before = self._commitment, self._unsent
        announced, following = commitment.announced(), commitment.following
        if before is not None and announced is not None:
            start = None if following is None else commitment.start()
            released = start is not None and start.column and not announced.column
            first = announced.epoch <= self._agreements.since
            if released or first or not self._agreements.recall(announced.epoch):
                return False
            if start is not None and start != announced:
                commitment.carry_on(HoldReason.LATE)
            if self._reservation.columns.unreserved() or not commitment.column:
                self._reservation.withdraw()
            commitment.announced_until = before
        # The statements, too, are to be repeated at once.
        self._unsent, self.next_at = None, 0
        return True

    def _repeated(self) -> list[WirePlan]:
        """Return one of the plans that a peer needs for a proposal, each in turn."""
        plans = self._agreements.unanswered()
        self._turn += 1
        return [plans[self._turn % len(plans)]] if plans else []

    def _statements(
        self, epoch: int, outside: float, *, every: bool, farewell: bool = False
    ) -> list[Message]:
        """Return the statement of ``every`` agreement, or of those that changed; ``epoch`` (µs): own plan."""
        agreements = self._agreements
        if not every and not agreements.changed:
            return []
        entries = agreements.entries(every=every)
        statement = Statement(
            agreements.fingerprint, epoch, agreements.since, entries, farewell, outside=outside
        )
        return [Tunnel(self._own, 0, 0, AGREEMENTS, pack_statement(part)) for part in in_messages(statement)]
