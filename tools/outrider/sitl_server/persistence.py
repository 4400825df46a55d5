"""Persistence of vehicles between starts: parameters and plans, one JSON file per vehicle."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from outrider.errors import InputError
from outrider.sitl_server.vehicle_group import VehicleGroup
from sitl.autopilot.saved import Saved

_ID_PARAMETERS: Final = ("SYSID_THISMAV", "MAV_SYS_ID")


class Persistence:
    """Files FLAVOUR-ID.json in ``directory``, by the id that a vehicle was started with.

    Without a directory nothing is stored.
    """

    def __init__(self, directory: Path | None, flavour: str) -> None:
        self._directory, self._flavour = directory, flavour
        self._kept: dict[int, Saved] = {}
        self._complained = False

    def saved(self, system: int) -> Saved:
        """Return the stored data of vehicle ``system``. Raises InputError if its file is damaged."""
        kept = Saved()
        path = self._path(system)
        if path is not None and path.exists():
            try:
                kept = Saved.model_validate_json(path.read_bytes())
                # Ids are given by --first-id: two vehicles must never share one.
                others = {name: v for name, v in kept.parameters.items() if name not in _ID_PARAMETERS}
                kept = kept.model_copy(update={"parameters": others})
            except (OSError, ValidationError) as error:
                why = error.strerror if isinstance(error, OSError) else "it is damaged"
                raise InputError(
                    f"{path}: cannot be used: {why}; allowed: a file that outrider sitl wrote, or no file"
                ) from None
        self._kept[system] = kept
        return kept

    def keep(self, group: VehicleGroup, *, ending: bool = False) -> None:
        """Write the data that have changed since the last call; a file is replaced as a whole.

        The newest signature stamp changes all the time, so it alone causes a write only when ``ending``.
        """
        if self._directory is None:
            return
        for slot in group.slots:
            found, before = slot.node.saved, self._kept[slot.system]
            compared = found
            if not ending:
                compared = found.model_copy(update={"signed_until": before.signed_until})
            if compared != before and not (_empty(compared) and _empty(before)):
                self._kept[slot.system] = found
                path = self._path(slot.system)
                if path is not None:
                    self._write(path, found)

    def _write(self, path: Path, kept: Saved) -> None:
        """Replace the file at ``path``. A missing or full directory ends no flight; it is reported once."""
        beside = path.with_suffix(".new")
        try:
            beside.write_text(kept.model_dump_json(indent=1), encoding="utf-8")
            beside.replace(path)
        except OSError as error:
            if not self._complained:
                self._complained = True
                sys.stderr.write(
                    f"outrider sitl: {path}: cannot be written, nothing is kept: {error.strerror}\n"
                )

    def _path(self, system: int) -> Path | None:
        return None if self._directory is None else self._directory / f"{self._flavour}-{system}.json"


def _empty(saved: Saved) -> bool:
    return not saved.parameters and not any(saved.plans) and not saved.signed_until


def prepare(directory: Path | None, flavour: str, systems: range) -> None:
    """Create the directory and check its files. Raises InputError if it or a file cannot be used."""
    if directory is None:
        return
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be made: {error.strerror}") from None
    persistence = Persistence(directory, flavour)
    for system in systems:
        persistence.saved(system)
