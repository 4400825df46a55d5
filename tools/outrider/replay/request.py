"""Request of ``outrider replay``: log, ids, speed and destination."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from mavlink_bridge.clocks.clock import WallClock
from mavlink_bridge.errors import EndpointError, LinkError, LogError
from mavlink_bridge.links.opening import open_link
from mavlink_bridge.tlog.log import read_tlog
from outrider.errors import InputError
from outrider.replay.command import replay as reenacting
from outrider.replay.log_command import Pacing, chasing, replay_log
from outrider.replay.telemetry import Forwarder, paced
from outrider.shadow.roles import Roles
from outrider.terminal.share_progress import share_progress

_ALLOWED_LOGS = "allowed: a .tlog, a .tlog.gz, or the directory of a run"
_ALLOWED_ACTIONS = "allowed: --list, --own ID, --target ID, --to ENDPOINT, or the directory of a run"


class Request(NamedTuple):
    """Options of the command, as they were given."""

    log: Path
    own: int | None = None
    neighbours: str | None = None
    target: int | None = None
    like: str = "escort"
    speed: float | None = None
    to: str | None = None
    out: Path | None = None
    as_json: bool = False

    def run(self) -> int:
        """Run the replay and return the exit status.

        Raises InputError for invalid options, for options that exclude each other, and as the actions do.
        """
        if self.speed is not None and not self.speed > 0.0:
            raise InputError(f"--speed {self.speed}: must be more than 0")
        if self.log.is_dir():
            self._only("the directory of a run", ("own", "neighbours", "target", "speed", "to", "out"))
            return reenacting(self.log, self.as_json)
        if self.own is None and self.target is not None:
            self._only("--target without --own", ("neighbours", "speed", "to"))
            return chasing(self.log, self.target, self.like, self.out, self.as_json)
        if self.own is None:
            if self.to is None:
                if not self.log.exists():
                    raise InputError(f"{self.log}: no such file or directory; {_ALLOWED_LOGS}")
                raise InputError(f"replay {self.log}: no action is given; {_ALLOWED_ACTIONS}")
            self._only("--to without --own", ("neighbours", "out"))
            return self._send()
        cast = Roles(self.own, _systems(self.neighbours), self.target)
        with self._paced() as pacing:
            return replay_log(self.log, cast, self.like, self.out, self.as_json, pacing)

    def _send(self) -> int:
        """Send the log's telemetry to the endpoint."""
        try:
            records = read_tlog(self.log)
            with self._paced() as pacing, share_progress() as watch:
                size, done = max(self.log.stat().st_size, 1), 0
                for record in pacing(records):
                    done += 8 + len(record.frame)
                    watch(self.log.name, min(done / size, 1.0))
        except (LogError, OSError) as error:
            raise InputError(str(error)) from None
        return 0

    @contextmanager
    def _paced(self) -> Iterator[Pacing]:
        """Yield a filter that passes records on at the requested speed.

        With an endpoint it also sends their telemetry there; the speed is then the log's own unless another
        one is given.
        """
        clock = WallClock()
        if self.to is None:
            yield lambda records: paced(records, clock, self.speed)
            return
        try:
            link = open_link(self.to, clock)
        except (EndpointError, LinkError, LogError) as error:
            raise InputError(f"--to: {error}") from None
        try:
            forwarder = Forwarder(link)
            speed = 1.0 if self.speed is None else self.speed
            yield lambda records: paced(records, clock, speed, forwarder)
            gone = link.counters.sent
            if self.own is None and self.as_json:
                counts = {"to": self.to, "telemetry": forwarder.sent, "kept": forwarder.kept, "sent": gone}
                sys.stdout.write(json.dumps(counts) + "\n")
            sys.stderr.write(
                f"{self.to}: {gone} of {forwarder.sent} frames of telemetry were sent; "
                f"{forwarder.kept} others were kept back\n"
            )
        finally:
            link.close()

    def _only(self, what: str, others: tuple[str, ...]) -> None:
        for name in others:
            if getattr(self, name) is not None:
                raise InputError(f"replay {self.log}: --{name} does not go with {what}")


def _systems(words: str | None) -> frozenset[int] | None:
    """Return the system ids in a text such as ``11,12``."""
    if words is None:
        return None
    found = set()
    for word in words.split(","):
        if not word.strip().isdecimal() or not 1 <= int(word) <= 255:
            raise InputError(
                f"--neighbours {words}: {word.strip()!r} is no system id; allowed: 1 to 255, with commas"
            )
        found.add(int(word))
    return frozenset(found)
