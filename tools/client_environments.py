"""Set-up of the environments of the client software that tests/clients flies.

Each file of tests/clients/requirements gets an environment of its own in .venv/clients, because MAVSDK's two
APIs share one name and MAVProxy requires particular versions.

`make slow` runs this with the Python in .venv. Environments that are up to date are left unchanged. Where a
client has no wheel for this machine, its tests are skipped and a message says so; in CI it is an error.
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
    """Make all environments; return 1 if one is missing in CI."""
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
    """Make the environment of one requirements file, unless it is up to date.

    Raises SetupError and leaves no environment if that fails.
    """
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
    """Make a new environment with the packages of a file; raise SetupError if that fails."""
    options = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r", requirements]
    uv = shutil.which("uv")
    if uv:
        run(uv, "venv", "--quiet", "--python", sys.executable, str(folder))
        run(uv, "pip", "install", "--quiet", "--python", python, *options)
        return
    # The pip of .venv can usually do it, which saves each client a pip of its own.
    made = works([sys.executable, "-m", "venv", "--without-pip", str(folder)])
    pip = find_pip(sys.executable, python) if made else []
    install([*(pip or make_environment(sys.executable, str(folder))), "install", *options], requirements)


def run(*command: str) -> None:
    """Run a command; raise SetupError if it fails."""
    if subprocess.call(command, stdin=subprocess.DEVNULL) != 0:
        raise SetupError(f"{command[0]} failed, see above")


if __name__ == "__main__":
    sys.exit(main())
