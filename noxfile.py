"""Tests with every supported version of Python whose interpreter is there: ``nox``, see docs/platforms.md.

A session makes its own environment with pip. ``nox -s tests-3.13 -- tests/companion`` runs a part.
"""

from __future__ import annotations

import nox

nox.options.default_venv_backend = "venv"
nox.options.error_on_missing_interpreters = False
nox.options.reuse_existing_virtualenvs = True
nox.options.stop_on_first_error = False

VERSIONS = ("3.11", "3.12", "3.13", "3.14")
EXTRAS = "sitl,export,view,cluster,gym,pandas"


@nox.session(python=VERSIONS)
def tests(session: nox.Session) -> None:
    """All tests but the slow ones, or those that are named."""
    # The newest pip knows dependency groups (PEP 735).
    session.install("--upgrade", "pip>=25.1")
    session.install("-e", f".[{EXTRAS}]", "--group", "dev")
    session.run("pytest", "-m", "not slow", "-n", "2", "--dist", "loadfile", *session.posargs)


@nox.session(python=VERSIONS)
def wheel(session: nox.Session) -> None:
    """The wheel alone, without extras, away from the checkout: a planner in a loop, and a flight."""
    session.install(".")
    root = session.invoked_from
    with session.chdir(session.create_tmp()):
        session.run("outrider", "--version")
        session.run("python", f"{root}/examples/planner.py")
        session.run("outrider", "swarm", "antipodal-8", "--vehicles", "3", "--json")
