"""docs/sitl.md says what the command has, all of it and nothing else."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.mavutil import mode_mapping_acm
from typer.main import get_command

from mavlink_bridge.messages import CommandAck, CommandLong, Source, StatusText
from outrider.__main__ import app
from tests.clients.sitl_process import Sitl
from tests.sitl.autopilot_rig import FLAVOURS, Rig

TEXT = (Path(__file__).parents[2] / "docs" / "sitl.md").read_text(encoding="utf-8")
OF_OTHERS = {"--master"}


def test_every_option_is_documented_and_every_documented_one_exists() -> None:
    command = get_command(app).commands["sitl"]  # type: ignore[attr-defined]
    options = {option for parameter in command.params for option in parameter.opts}
    assert set(re.findall(r"--[a-z][a-z-]*", TEXT)) - OF_OTHERS == options


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_what_is_said_not_to_be_flown_is_refused_with_a_reason(flavour: str) -> None:
    (said,) = re.findall(r"^- Not flown, and refused.*?(?=^- )", TEXT, re.MULTILINE | re.DOTALL)
    numbers = {name: number for number, name in mode_mapping_acm.items()}
    modes = {name for name in re.findall(r"[A-Z_]{4,}", said) if name in numbers} - {"STABILIZE"}
    assert {"POSHOLD", "ALT_HOLD", "CIRCLE", "SMART_RTL"} <= modes
    calls = [(34, (5.0, 2.0)), *((176, (1.0, numbers[name])) for name in modes if flavour == "ardupilot")]
    rig = Rig(flavour, start_height=5.0)
    rig.run(1.2)
    before = rig.autopilot.mode
    for command, given in calls:
        params: tuple[float, ...] = (*map(float, given), *(0.0,) * 5)
        rig.step(CommandLong(Source(255, 190), 11, 1, command, 0, params))  # type: ignore[arg-type]
        assert rig.all(CommandAck)[-1].result in (2, 3)
        assert rig.all(StatusText)[-1].text
        assert rig.autopilot.mode is before
    assert len(rig.all(StatusText)) >= len(calls)


@pytest.mark.slow
def test_its_program_arms_takes_off_and_flies_there() -> None:
    (program,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert program.count("tcp:127.0.0.1:5760") == 1
    with Sitl("ardupilot", 1) as sitl:
        sitl.start()
        text = program.replace("tcp:127.0.0.1:5760", sitl.endpoint(0))
        client = subprocess.run(
            [sys.executable, "-c", text], capture_output=True, text=True, timeout=120.0, check=False
        )
    assert client.stdout.splitlines() == ["armed: 0", "take-off: 0", "there"], client.stderr
