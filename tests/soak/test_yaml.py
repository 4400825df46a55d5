"""Damaged configuration files: a value or InputError, with every fault in its place; and what is accepted can
be written, read again, and built."""

from __future__ import annotations

import json
from random import Random

import pytest
from pydantic import BaseModel

from outrider.errors import Fault, InputError
from outrider.resources import config_root, find
from outrider.scenarios.scenario import Scenario
from outrider.simulation.flight import Flight
from outrider.sweep.draw import draw
from outrider.sweep.grid import Sweep, points
from outrider.sweep.scenes import Scene
from outrider.yaml_files.yaml_file import MOST_BYTES, load, read
from sitl.vehicle.airframe import airframe, hover_speeds
from sitl.vehicle.config import VehicleConfig
from tests.soak.campaigns import Mutant, Mutants, bounded_memory
from tests.soak.damage import EDITS, damaged

MODELS: dict[str, type[BaseModel]] = {
    "scenarios": Scenario,
    "vehicles": VehicleConfig,
    "sweeps": Sweep,
    "scenes": Scene,
}
FILES = [
    (path.read_bytes(), model)
    for kind, model in MODELS.items()
    for path in sorted((config_root() / kind).glob("*.yaml"))
]
DATA = [data for data, _ in FILES]
FIREFLY = load(find("vehicles", "firefly"), VehicleConfig)
LOGS = config_root() / "logs"
MOST_VEHICLES = 20
"""A scenario with more is not built: it takes long."""
BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12)
)
NUMBERS = (
    *("0", "-0.0", "1", "-1", "3", "4", "244", "245", "1e-320", "1e308", "1e309", "-1e400", ".inf", "-.Inf"),
    *(".nan", "0x7fffffffffffffff", "0o17", "1_000", "9" * 400, "9" * 5000, "1e999999999", "2.5e-3", "7:30"),
    *("9223372036854775807", "9223372036854775808", "-9223372036854775809", "18446744073709551616"),
)
WORDS = (
    *("null", "~", "''", "true", "no", "[]", "{}", "[[]]", "{a: 1}", "!!python/object:os.system x", "<<: *a"),
    *("&a x", "*a", "*nobody", "&a [*a]", "? x", "- - - -", "|\n  x\n", ">-\n  x\n", "'", '"', '"\\ud800"'),
    *(
        '"\\UFFFFFFFF"',
        "\u2028",
        "\x85",
        "\ufeff",
        "\U0001f681",
        "e\u0301",
        "\x00",
        "\x1b[31m",
        "%YAML 9.9\n",
    ),
    *("---\n", "...\n", "\t", "# ", "key: {key: {key: 1}}", "[" * 40, "{a: " * 40, "- " * 40, BOMB),
)


def mutated(random: Random) -> tuple[bytes, type[BaseModel]]:
    """A shipped file with a few values, lines or bytes changed."""
    data, model = random.choice(FILES)
    if random.random() < 0.7:
        text = data.decode()
        for _ in range(random.choice((1, 1, 2, 4))):
            text = random.choice((_value, _value, _line, _word, _nest))(random, text)
        data = text.encode(errors="surrogatepass")
    if random.random() < 0.4:
        data = damaged(random, data, DATA, EDITS)
    return data, model


def _value(random: Random, text: str) -> str:
    """What follows a colon, comma or bracket becomes another number or word."""
    places = [at + 1 for at, character in enumerate(text) if character in ":,["]
    at = random.choice(places or [0])
    end = at
    while end < len(text) and text[end] not in ",]}\n":
        end += 1
    return f"{text[:at]} {random.choice(random.choice((NUMBERS, WORDS)))}{text[end:]}"


def _line(random: Random, text: str) -> str:
    """A line elsewhere, twice, deeper, or not at all."""
    lines = text.splitlines(keepends=True) or [""]
    line = lines.pop(random.randrange(len(lines)))
    for _ in range(random.choice((0, 1, 2))):
        indent = " " * random.choice((0, 0, 2, 4))
        lines.insert(random.randint(0, len(lines)), indent + line)
    return "".join(lines)


def _word(random: Random, text: str) -> str:
    """A token anywhere."""
    at = random.randint(0, len(text))
    return text[:at] + random.choice(random.choice((NUMBERS, WORDS))) + text[at + random.randint(0, 6) :]


def _nest(random: Random, text: str) -> str:
    """Deep nesting, or a value that stands for many."""
    depth = random.choice((5, 31, 32, 33, 5000))
    opened, closed = random.choice((("[", "]"), ("{a: ", "}"), ("- ", "")))
    return f"{text}\nmore: {opened * depth}1{closed * depth}\n"


def check_faults(error: InputError, data: bytes) -> None:
    lines = data.decode(errors="replace").removeprefix("\ufeff").split("\n")
    assert len(str(error).split("\n")) == len(error.faults) > 0
    for fault in error.faults:
        assert isinstance(fault, Fault)
        assert len(str(fault)) < 2000
        if fault.line is not None and fault.column is not None:
            assert 1 <= fault.line <= len(lines)
            assert 1 <= fault.column <= len(lines[fault.line - 1]) + 1


def check_value(value: BaseModel) -> None:
    """What was accepted comes back from a file, and can be used or is refused in so many words."""
    model = type(value)
    document = json.dumps(value.model_dump(mode="json"), allow_nan=False)
    assert read(document.encode(), "again", model) == value
    try:
        if isinstance(value, Scenario) and value.vehicles <= MOST_VEHICLES:
            Flight(value, FIREFLY, 1, LOGS)
        elif isinstance(value, VehicleConfig):
            assert (hover_speeds(value) > 0.0).all()
            assert airframe(value).step > 0.0
        elif isinstance(value, Sweep):
            assert len(list(points(value))) >= 1
        elif isinstance(value, Scene):
            read(json.dumps(draw(value, 1)).encode(), "drawn", Scenario)
    except InputError:
        return


def test_any_file_is_a_value_or_an_input_error(mutants: Mutants) -> None:
    for mutant in mutants:
        with mutant:
            data, model = mutated(mutant.random)
            try:
                value = read(data, "mutant.yaml", model)
            except InputError as error:
                check_faults(error, data)
                continue
            check_value(value)


def test_shipped_files_are_good() -> None:
    assert {model for _, model in FILES} == set(MODELS.values())
    for data, model in FILES:
        check_value(read(data, "shipped.yaml", model))


def test_what_json_writes_of_any_character_is_read() -> None:
    """JSON escapes what lies beyond U+FFFF as two halves; a sweep hands its scenarios on in JSON."""
    value = load(find("scenarios", "escort"), Scenario)
    check_value(value.model_copy(update={"description": "\U0001f681"}))


LARGE = {
    "comments": "#\n" * 500_000,
    "a long list": f"a: [{'1,' * 400_000}]",
    "a long text": f"a: {'x ' * 500_000}",
    "a text of many lines": "a:\n" + " x\n" * 330_000,
    "escapes": 'a: "' + "\\x41" * 250_000 + '"',
    "many keys": "".join(f"k{number}: 1\n" for number in range(80_000)),
    "a block": "a: |\n" + " x\n" * 330_000,
    "a folded block": "a: >\n" + "  x\n\n" * 180_000,
    "colons": ":" * 1_000_000,
    "a long tag": "!" + "a" * 900_000,
    "documents": "---\n" * 250_000,
    "digits": "a: " + "9" * 900_000,
    "aliases of nothing": f"a: [{'*b,' * 300_000}]",
    "aliases of much": f"a: &a [{'x,' * 400}]\nb: [{'*a,' * 200_000}]",
    "the same key": "{" + "a," * 400_000 + "}",
    "dashes": "- " * 400_000,
}


@pytest.mark.soak
@pytest.mark.parametrize("text", LARGE.values(), ids=LARGE.keys())
def test_the_largest_files_are_refused_soon(text: str) -> None:
    """As large as a file may be: what takes seconds here would take an hour if it grew with the square."""
    assert len(text) <= MOST_BYTES
    with bounded_memory(), Mutant("largest", 1, 0), pytest.raises(InputError):
        read(text.encode(), "large.yaml", Scenario)
