"""Make the environments of the client software that tests/clients flies: one in .venv/clients for each file
of tests/clients/requirements, as MAVSDK's two APIs have one name and MAVProxy wants versions of its own.

Run by `make slow`, by the Python in .venv. What is there and up to date is left alone. Where a client has no
wheel for this machine, its tests are skipped, and that is said; but in CI it is an error.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from bootstrap import SetupError, find_pip, install, make_environment, say, works

ROOT = Path(__file__).parents[1]
REQUIREMENTS = ROOT / "tests" / "clients" / "requirements"
CLIENTS = ROOT / ".venv" / "clients"


def main() -> int:
    """Status 1 if an environment is missing where none may be."""
    missing = []
    for requirements in sorted(REQUIREMENTS.glob("*.txt")):
        try:
            provide(requirements)
        except SetupError as error:
            missing.append(requirements.stem)
            sys.stderr.write(f"outrider: client {requirements.stem}: {error}\n")
    if missing and os.environ.get("CI"):
        return 1
    if missing:
        say(f"tests with {', '.join(missing)} are skipped")
    else:
        (CLIENTS / ".made").write_text("made by tools/client_environments.py\n")
    return 0


def provide(requirements: Path) -> None:
    """An environment with just what one file names, unless it is there. Raises SetupError; then there is
    none."""
    folder = CLIENTS / requirements.stem
    stamp, python = folder / ".made", folder / "bin" / "python"
    content = hashlib.sha256(requirements.read_bytes()).hexdigest()
    if stamp.is_file() and stamp.read_text() == content and works([str(python), "-c", ""]):
        return
    say(f"setting up the client {requirements.stem}")
    CLIENTS.mkdir(exist_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
    try:
        fill(folder, str(python), str(requirements))
    except SetupError:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    stamp.write_text(content)


def fill(folder: Path, python: str, requirements: str) -> None:
    """A new environment with what a file names. Raises SetupError."""
    options = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r", requirements]
    uv = shutil.which("uv")
    if uv:
        run(uv, "venv", "--quiet", "--python", sys.executable, str(folder))
        run(uv, "pip", "install", "--quiet", "--python", python, *options)
        return
    # The pip of .venv can do it, as a rule, which saves each client one of its own.
    made = works([sys.executable, "-m", "venv", "--without-pip", str(folder)])
    pip = find_pip(sys.executable, python) if made else []
    install([*(pip or make_environment(sys.executable, str(folder))), "install", *options], requirements)


def run(*command: str) -> None:
    """Raises SetupError."""
    if subprocess.call(command, stdin=subprocess.DEVNULL) != 0:
        raise SetupError(f"{command[0]} failed, see above")


if __name__ == "__main__":
    sys.exit(main())
