"""Set-up of the environment in ``.venv`` from locked versions: with uv if available, else venv and pip.

`make` runs this with whatever python3 the machine has. The syntax is that of Python 3.6, so that an older
version than required can still report what is missing.
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
    """The reason why the environment cannot be made, in one line."""


def main() -> int:
    """Make the environment and stamp it; return 1 after one line of error if that is impossible."""
    try:
        uv = shutil.which("uv")
        if uv:
            with_uv(uv)
        else:
            with_pip(new_enough_python())
        compile_planner()
    except SetupError as error:
        sys.stderr.write(f"outrider: {error}\n")
        return 1
    with open(STAMP, "w") as stamp:
        stamp.write("made by tools/bootstrap.py\n")
    return 0


def new_enough_python() -> str:
    """Return this interpreter, or a newer one that is installed beside it; raise SetupError if none is."""
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
    """Make .venv with uv, which finds or downloads a Python and shows its own progress."""
    say("setting up .venv with uv")
    environment = dict(os.environ, UV_PROJECT_ENVIRONMENT=VENV)
    extras = [
        word
        for extra in ("sitl", "export", "view", "cluster", "gym", "pandas")
        for word in ("--extra", extra)
    ]
    command = [uv, "sync", "--locked", *extras, "--project", ROOT]
    if subprocess.call(command, stdin=subprocess.DEVNULL, env=environment) != 0:
        raise SetupError("uv sync failed, see above")


def with_pip(python: str) -> None:
    """Make .venv with venv (or virtualenv) and pip, which checks each package against its hash."""
    say("setting up .venv with pip, about a minute the first time")
    is_good = f"import sys; sys.exit(sys.version_info < {NEEDED})"
    pip = find_pip(python, PYTHON) if works([PYTHON, "-c", is_good]) else []
    if not pip:
        pip = make_environment(python, VENV)
    install([*pip, "install", "--require-hashes", "-r", REQUIREMENTS], REQUIREMENTS)
    install([*pip, "install", "--no-deps", "--no-build-isolation", "-e", ROOT], REQUIREMENTS)


def make_environment(python: str, folder: str) -> "list[str]":
    """Replace ``folder`` by a new environment, and return a pip command that installs into it."""
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


def compile_planner() -> None:
    """Compile the planner's kernels now, once: the first start would otherwise wait for it."""
    say("compiling the planner, about a minute the first time")
    if subprocess.call([PYTHON, "-c", "import companion.node"], stdin=subprocess.DEVNULL, cwd=ROOT) != 0:
        raise SetupError("the planner cannot be imported, see above")


def find_pip(python: str, target: str) -> "list[str]":
    """Return a pip command that installs for the Python ``target``, or an empty list.

    It is the target's own pip, or one of the machine that supports ``--python``.
    """
    own = [target, "-m", "pip"]
    steered = [[*pip, "--python", target] for pip in ([python, "-m", "pip"], ["pip3"], ["pip"])]
    return next((pip for pip in (own, *steered) if works([*pip, "--version"])), [])


def install(command: "list[str]", requirements: str) -> None:
    """Run pip, and show its progress through the file ``requirements``; show its last lines if it fails."""
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
    """Show a line that replaces the last one on a terminal; elsewhere show milestones only."""
    if sys.stdout.isatty():
        sys.stdout.write("\r\033[K" + text[:78])
        sys.stdout.flush()
    elif milestone:
        say(text)


def say(text: str) -> None:
    """Write one line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def works(command: "list[str]") -> bool:
    """Return whether a command can be run and succeeds; its output is discarded."""
    nothing = subprocess.DEVNULL
    try:
        return subprocess.call(command, stdin=nothing, stdout=nothing, stderr=nothing) == 0
    except OSError:
        return False


if __name__ == "__main__":
    sys.exit(main())
