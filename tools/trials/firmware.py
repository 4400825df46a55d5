"""Simulations of real firmware that a trial starts: ArduPilot's SITL and PX4's SIH.

Each runs in a directory of its own, in which its parameters and logs start fresh.
"""

from __future__ import annotations

import os
import socket
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mavlink_bridge.frames import FleetFrame
from outrider.errors import InputError, OutriderError
from trials.autopilots import Program
from trials.plan import HOST, ROW

_TCP: Final = {"ardupilot": (5760, 5762, 5763), "px4": ()}
_UDP: Final = {"ardupilot": (), "px4": (14540, 14580, 18570)}
_STEP: Final = {"ardupilot": 10, "px4": 1}
_FAREWELL: Final = 6.0
"""Time after which a process that does not end is killed (s)."""
_LAST: Final = 300
"""Length of the end of its output that is shown (characters)."""


@dataclass(frozen=True)
class StartCommand:
    """Start parameters of a program: ``command``, with ``environment`` in addition to the inherited one.

    ``endpoint`` is the companion's; ``told`` is another one for the true state.
    """

    command: tuple[str, ...]
    environment: dict[str, str]
    endpoint: str
    told: str


def launch(program: Program, system: int, fleet: FleetFrame, row: float = ROW) -> StartCommand:
    """Return the start parameters of vehicle ``system``, which stands in a row, ``row`` metres from the next.

    The instance is ``system`` − 1, as PX4 derives its system id from it.
    """
    instance = system - 1
    latitude, longitude, altitude = fleet.to_geodetic((row * instance, 0.0, 0.0))
    if program.flavour == "ardupilot":
        words = [f"-I{instance}", "--sysid", str(system), "-S", "--speedup", "1"]
        home = f"{latitude:.9f},{longitude:.9f},{altitude:.3f},0"
        first, told = (port + _STEP["ardupilot"] * instance for port in _TCP["ardupilot"][:2])
        return StartCommand(
            (str(_program(program.path)), *words, "--home", home, *program.words),
            {},
            f"tcp:{HOST}:{first}",
            f"tcp:{HOST}:{told}",
        )
    binary, data = _px4(program.path)
    settings = dict(word.split("=", 1) for word in program.words if "=" in word)
    more = [word for word in program.words if "=" not in word]
    place = {"PX4_HOME_LAT": latitude, "PX4_HOME_LON": longitude, "PX4_HOME_ALT": altitude}
    return StartCommand(
        (str(binary), "-i", str(instance), "-d", str(data), *more),
        {
            "PX4_SIM_MODEL": "sihsim_quadx",
            "PX4_SIMULATOR": "sihsim",
            **{name: f"{value:.9f}" for name, value in place.items()},
            **settings,
        },
        f"udpin:{HOST}:{_UDP['px4'][0] + instance}",
        f"udpin:{HOST}:14550",
    )


def _program(text: str) -> Path:
    path = Path(text).expanduser().resolve()
    if not path.is_file() or not os.access(path, os.X_OK):
        raise InputError(
            f"--autopilots: {text} is no program; name build/sitl/bin/arducopter of an ArduPilot"
        )
    return path


def _px4(text: str) -> tuple[Path, Path]:
    """Return the binary and its start scripts. ``text`` is the folder of a build for SITL, or its binary."""
    path = Path(text).expanduser().resolve()
    build = path if path.is_dir() else path.parent.parent
    binary, data = build / "bin" / "px4", build / "etc"
    if not (binary.is_file() and os.access(binary, os.X_OK) and data.is_dir()):
        raise InputError(
            f"--autopilots: {text} is no build of PX4 for SITL: it has no bin/px4 and etc; name"
            " build/px4_sitl_default"
        )
    return binary, data


class Firmware:
    """Running ``programs``, by system id, ``row`` metres apart. Raises InputError if a port is in use."""

    def __init__(
        self, programs: dict[int, Program], fleet: FleetFrame, directory: Path, row: float = ROW
    ) -> None:
        self.launches = {system: launch(program, system, fleet, row) for system, program in programs.items()}
        for system, program in programs.items():
            _free(program.flavour, system)
        self._directory = directory
        self.processes: dict[int, subprocess.Popen[bytes]] = {}
        with ExitStack() as files:
            files.callback(self.close)
            for system, started in self.launches.items():
                place = self._place(system)
                place.mkdir(parents=True)
                with (place / "out.log").open("wb") as out:
                    self.processes[system] = subprocess.Popen(
                        started.command,
                        cwd=place,
                        env={**os.environ, **started.environment},
                        stdin=subprocess.DEVNULL,
                        stdout=out,
                        stderr=subprocess.STDOUT,
                        start_new_session=True,
                    )
            files.pop_all()

    def check(self) -> None:
        """Raise OutriderError if a process has ended."""
        for system, process in self.processes.items():
            if process.poll() is not None:
                log = self._place(system) / "out.log"
                last = log.read_text(encoding="utf-8", errors="replace")[-_LAST:].strip()
                raise OutriderError(
                    f"the firmware of vehicle {system} ended, status {process.returncode}: see {log}\n{last}"
                )

    def close(self) -> None:
        """End all processes."""
        for process in self.processes.values():
            if process.poll() is None:
                process.terminate()
        for process in self.processes.values():
            with suppress(subprocess.TimeoutExpired):
                process.wait(_FAREWELL)
            if process.poll() is None:
                process.kill()
                process.wait()

    def _place(self, system: int) -> Path:
        return self._directory / f"firmware-{system}"


def _free(flavour: str, system: int) -> None:
    """Raise InputError if a port that the firmware or its companion would open is not free."""
    kinds: Sequence[tuple[tuple[int, ...], int, str]] = (
        (_TCP[flavour], socket.SOCK_STREAM, "TCP"),
        (_UDP[flavour], socket.SOCK_DGRAM, "UDP"),
    )
    for ports, kind, name in kinds:
        for base in ports:
            port = base + _STEP[flavour] * (system - 1)
            with socket.socket(socket.AF_INET, kind) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(kind == socket.SOCK_STREAM))
                try:
                    probe.bind((HOST, port))
                except OSError as error:
                    raise InputError(
                        f"{name} port {port} of vehicle {system}: {error.strerror}. End the simulation that"
                        " has it, or fly that one: --autopilots ENDPOINT,…"
                    ) from None
