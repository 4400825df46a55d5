"""Make the environment in ``.venv``: with uv where it is, else with venv and pip, both from locked versions.

Run by `make`, with whatever python3 the machine has: its syntax is that of Python 3.6, so that an older one
than is needed can still say what is missing.
"""

import os
import re
import shutil
import subprocess
import sys

NEEDED = (3, 11)
NEWER = ("python3.14", "python3.13", "python3.12", "python3.11")
ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
VENV = os.path.join(ROOT, ".venv")
PYTHON = os.path.join(VENV, "bin", "python")
STAMP = os.path.join(VENV, ".made")
REQUIREMENTS = os.path.join(ROOT, "requirements.txt")


class SetupError(Exception):
    """Why there is no environment, in one line."""


def main() -> int:
    """Make the environment and stamp it; status 1 and one line if that is impossible here."""
    try:
        uv = shutil.which("uv")
        if uv:
            with_uv(uv)
        else:
            with_pip(new_enough_python())
    except SetupError as error:
        sys.stderr.write(f"outrider: {error}\n")
        return 1
    with open(STAMP, "w") as stamp:
        stamp.write("made by tools/bootstrap.py\n")
    return 0


def new_enough_python() -> str:
    """This interpreter, or a newer one that is installed beside it."""
    if sys.version_info >= NEEDED:
        return sys.executable
    for name in NEWER:
        found = shutil.which(name)
        if found:
            return found
    here, needed = (".".join(str(part) for part in version[:2]) for version in (sys.version_info, NEEDED))
    raise SetupError(
        f"Python {needed} or newer is needed, python3 is {here} here; install one (or uv, which fetches it), "
        "or name it: make PYTHON=python3.12"
    )


def with_uv(uv: str) -> None:
    """uv makes .venv, finds or fetches a Python, and shows its own progress."""
    say("setting up .venv with uv")
    environment = dict(os.environ, UV_PROJECT_ENVIRONMENT=VENV)
    extras = [word for extra in ("sitl", "export", "view", "cluster") for word in ("--extra", extra)]
    command = [uv, "sync", "--locked", *extras, "--project", ROOT]
    if subprocess.call(command, stdin=subprocess.DEVNULL, env=environment) != 0:
        raise SetupError("uv sync failed, see above")


def with_pip(python: str) -> None:
    """venv (or virtualenv) and pip; each package is checked against its hash."""
    say("setting up .venv with pip, about a minute the first time")
    is_good = f"import sys; sys.exit(sys.version_info < {NEEDED})"
    pip = find_pip(python, PYTHON) if works([PYTHON, "-c", is_good]) else []
    if not pip:
        pip = make_environment(python, VENV)
    install([*pip, "install", "--require-hashes", "-r", REQUIREMENTS], REQUIREMENTS)
    install([*pip, "install", "--no-deps", "--no-build-isolation", "-e", ROOT], REQUIREMENTS)


def make_environment(python: str, folder: str) -> "list[str]":
    """A new environment in place of what was there, and a pip that installs into it."""
    for way in (
        [python, "-m", "venv"],
        [python, "-m", "venv", "--without-pip"],
        [python, "-m", "virtualenv"],
        ["virtualenv", "-p", python],
    ):
        shutil.rmtree(folder, ignore_errors=True)
        pip = find_pip(python, os.path.join(folder, "bin", "python")) if works([*way, folder]) else []
        if pip:
            return pip
    shutil.rmtree(folder, ignore_errors=True)
    raise SetupError(
        f"this Python has neither ensurepip nor pip, so {os.path.basename(folder)} cannot be made; "
        "on Debian and Ubuntu: sudo apt install python3-venv"
    )


def find_pip(python: str, target: str) -> "list[str]":
    """A pip that installs for the Python ``target``: its own, or one of the machine that can be told to; else
    empty."""
    own = [target, "-m", "pip"]
    steered = [[*pip, "--python", target] for pip in ([python, "-m", "pip"], ["pip3"], ["pip"])]
    return next((pip for pip in (own, *steered) if works([*pip, "--version"])), [])


def install(command: "list[str]", requirements: str) -> None:
    """Run pip; of all that it says show how far it is in the file ``requirements``, and the end if it
    fails."""
    with open(requirements) as file:
        expected = sum("==" in line for line in file)
    quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
    pip = subprocess.Popen(
        [*command, *quiet],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
    )
    said = []
    fetched = 0
    for line in pip.stdout or ():
        said.append(line)
        collecting = re.match(r"Collecting ([\w.-]+)", line)
        if collecting:
            fetched += 1
            show(f"{fetched} of {expected}: {collecting.group(1)}", fetched % 10 == 0)
        elif line.startswith("Installing collected"):
            show("installing", True)
    show("", False)
    if pip.wait() != 0:
        sys.stderr.write("".join(said[-20:]))
        raise SetupError("pip failed, see above; run make again to go on")


def show(text: str, milestone: bool) -> None:
    """A line that replaces the last on a terminal; elsewhere only a milestone is worth one."""
    if sys.stdout.isatty():
        sys.stdout.write("\r\033[K" + text[:78])
        sys.stdout.flush()
    elif milestone:
        say(text)


def say(text: str) -> None:
    """One line, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def works(command: "list[str]") -> bool:
    """Whether a command can be run and succeeds, quietly."""
    nothing = subprocess.DEVNULL
    try:
        return subprocess.call(command, stdin=nothing, stdout=nothing, stderr=nothing) == 0
    except OSError:
        return False


if __name__ == "__main__":
    sys.exit(main())
