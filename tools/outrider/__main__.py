"""The command ``outrider``: all its sub-commands, and the exit status and message of each failure."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable
from typing import Annotated, Final, cast

import typer

from outrider.commands.campaigns import compare, gallery, paper, sweep
from outrider.commands.finding import listing, new
from outrider.commands.flying import doctor, fly, preflight, sitl, swarm
from outrider.commands.machine import bench, key
from outrider.commands.reading import export, replay, report, view
from outrider.commands.usage import usage_words
from outrider.errors import InputError, OutriderError

_HELP: Final = {"help_option_names": ["-h", "--help"]}
app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings=_HELP,
    help="A ring of drones escorts a moving target without colliding.",
)
BAD_INPUT, FAULT = 2, 3
_INTERRUPTED = 130
"""Exit status that typer returns for Ctrl-C."""
_EXTRAS: Final = {
    "jsbsim": "sitl",
    "mcap": "export",
    "pyarrow": "export",
    "viser": "view",
    "dask": "cluster",
    "distributed": "cluster",
}
"""Optional packages, and the extra that installs each."""
# Click's UsageError: typer does not export it, and newer versions contain their own copy of click.
_UsageError: Final = cast("type[typer.BadParameter]", typer.BadParameter.__base__)


def _show_version(wanted: bool) -> None:
    """Print the version and end."""
    if wanted:
        from outrider import __version__

        sys.stdout.write(f"outrider {__version__}\n")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version and exit.", callback=_show_version, is_eager=True),
    ] = False,
) -> None:
    """Make typer treat every command as a sub-command."""


def _help_of(command: Callable[..., None]) -> str:
    """Return the description of a command with each paragraph in one line, which the terminal then wraps."""
    paragraphs = (inspect.getdoc(command) or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


for _command in (
    swarm,
    view,
    sitl,
    doctor,
    preflight,
    fly,
    sweep,
    paper,
    compare,
    gallery,
    replay,
    export,
    report,
    key,
    bench,
    new,
):
    app.command(help=_help_of(_command), context_settings=_HELP)(_command)
app.command("list", help=_help_of(listing), context_settings=_HELP)(listing)


def main() -> None:
    """Run the command line.

    Bad input ends with status 2 and one line per fault; other errors and interruptions with status 3. A
    traceback is shown only for an internal fault if OUTRIDER_TRACEBACK is set; Python then ends with its own
    status, 1.
    """
    from mavlink_bridge.errors import BridgeError

    try:
        status = app(prog_name="outrider", standalone_mode=False)
    except InputError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(BAD_INPUT)
    except _UsageError as error:
        if said := usage_words(error):
            command = "outrider" if error.ctx is None else error.ctx.command_path
            line = f"{command}: {said}; see {command} --help"
            sys.stderr.write(f"{InputError(line)}\n")
        sys.exit(BAD_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        sys.stderr.write("outrider: stopped\n")
        sys.exit(FAULT)
    except (OutriderError, BridgeError, OSError) as error:
        sys.stderr.write(f"outrider: {error}\n")
        sys.exit(FAULT)
    except Exception as error:
        # Without a traceback an internal fault must not have the status of a collision, 1.
        if os.environ.get("OUTRIDER_TRACEBACK"):
            raise
        sys.stderr.write(f"outrider: {_words(error)}\n")
        sys.exit(FAULT)
    if status == _INTERRUPTED:
        sys.stderr.write("outrider: stopped\n")
        status = FAULT
    sys.exit(status)


def _words(error: Exception) -> str:
    """Return the error and a remedy as text."""
    if isinstance(error, ModuleNotFoundError):
        package = (error.name or "").partition(".")[0]
        if package in _EXTRAS:
            return (
                f"this command needs {package}, which is not installed: "
                f"pip install '.[{_EXTRAS[package]}]' in a checkout of outrider"
            )
    return f"{type(error).__name__}: {error}; OUTRIDER_TRACEBACK=1 shows where"


if __name__ == "__main__":
    main()
