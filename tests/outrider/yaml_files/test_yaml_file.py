"""The configuration loader: every fault at once and in its place, and nothing but InputError for any file."""

from __future__ import annotations

import json
import math
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field, model_validator

from outrider.errors import Fault, InputError
from outrider.schemas import schema, schema_line, text
from outrider.yaml_files.scalars import ScalarError, resolve
from outrider.yaml_files.yaml_file import MOST_BYTES, MOST_FAULTS, load, read


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Sense(Enum):
    LEFT = "left"
    RIGHT = "right"


class Fixed(Part):
    kind: Literal["fixed"]
    at: tuple[float, float, float]


class Walk(Part):
    kind: Literal["walk"]
    speed: float = Field(gt=0.0, le=10.0)


class Gust(Part):
    mean: float = Field(ge=0.0)
    peak: float = Field(ge=0.0)

    @model_validator(mode="after")
    def _order(self) -> Gust:
        if self.peak < self.mean:
            raise ValueError("peak must be at least mean")
        return self


class Flight(Part):
    name: str = Field(max_length=20)
    vehicles: int = Field(ge=1, le=244)
    period_us: int = Field(10_000, gt=0, multiple_of=4)
    gain: float = 1.0
    armed: bool = False
    sense: Sense = Sense.LEFT
    target: Annotated[Fixed | Walk, Field(discriminator="kind")] | None = None
    wind: float | Gust = 0.0
    marks: tuple[float, ...] = ()
    labels: dict[int, str] = {}
    parts: list[Gust] = []


GOOD = """\
name: 'first flight'   # words
vehicles: 8
gain: 1e3
armed: true
sense: right
target: {kind: fixed, at: [1, 2.5, -3e-1]}
wind:
  mean: 3
  peak: 5.5
marks: [1, 2]
labels:
  11: lead
parts:
  - {mean: 0, peak: 1}
"""


def faults(document: str | bytes) -> list[str]:
    """The lines about a bad document, without its name."""
    data = document if isinstance(document, bytes) else document.encode()
    with pytest.raises(InputError) as caught:
        read(data, "f.yaml", Flight)
    lines = str(caught.value).split("\n")
    assert all(line.startswith("f.yaml") for line in lines)
    return [line.removeprefix("f.yaml:") for line in lines]


def base(*extra: str) -> str:
    return "\n".join(["name: n", "vehicles: 2", *extra]) + "\n"


def test_a_good_file_is_what_it_says(tmp_path: Path) -> None:
    path = tmp_path / "good.yaml"
    path.write_text(GOOD, encoding="utf-8-sig")
    assert load(path, Flight) == Flight(
        name="first flight",
        vehicles=8,
        gain=1000.0,
        armed=True,
        sense=Sense.RIGHT,
        target=Fixed(kind="fixed", at=(1.0, 2.5, -0.3)),
        wind=Gust(mean=3.0, peak=5.5),
        marks=(1.0, 2.0),
        labels={11: "lead"},
        parts=[Gust(mean=0.0, peak=1.0)],
    )


def test_every_fault_is_said_at_once_in_the_order_of_the_file() -> None:
    document = """\
name: n
vehicels: 8
period_us: 10
gain: fast
target:
  kind: wlak
marks: [1, x]
gain: 2
parts:
  - {mean: 2}
"""
    assert faults(document) == [
        "1:1: 'vehicles' is missing; needed: a whole number ≥ 1 and ≤ 244",
        "2:1: 'vehicels' is unknown; allowed: name, vehicles, period_us, gain, armed, sense, target, wind, "
        "marks, labels, parts; did you mean 'vehicles'?",
        "3:12: period_us is 10; allowed: a whole number > 0, a multiple of 4",
        "4:7: gain is 'fast'; allowed: a number",
        "6:9: target.kind is 'wlak'; allowed: 'fixed', 'walk'; did you mean 'walk'?",
        "7:12: marks[1] is 'x'; allowed: a number",
        "8:1: key 'gain' is there twice; allowed: once",
        "10:5: 'peak' is missing in 'parts[0]'; needed: a number ≥ 0",
    ]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("gain: 1:30", "gain is '1:30'; allowed: a number; base 60 is not read, write one number"),
        ("gain: 1_000", "gain is '1_000'; allowed: a number; did you mean 1000?"),
        ("gain: 010", "gain is '010'; allowed: a number; did you mean 10?"),
        ("gain: 3,5", "gain is '3,5'; allowed: a number; did you mean 3.5?"),
        ("gain: '3.5'", "gain is '3.5'; allowed: a number; remove the quotes"),
        ("gain: .nan", ".nan is not finite; allowed: finite numbers"),
        ("gain: -.inf", "-.inf is not finite; allowed: finite numbers"),
        ("gain: 1e999", "1e999 is too large; allowed: finite numbers, magnitude below 1.8e308"),
        ("gain: nan", "gain is 'nan'; allowed: a number"),
        ("gain:", "gain is empty; allowed: a number"),
        ("gain: true", "gain is true; allowed: a number"),
        ("period_us: 8.0", "period_us is 8.0; allowed: a whole number > 0, a multiple of 4; did you mean 8?"),
        (
            "period_us: 99999999999999999999",
            "99999999999999999999 is out of range; allowed: integers from −2^63 to 2^63 − 1",
        ),
        ("armed: on", "armed is 'on'; allowed: true or false; did you mean true?"),
        ("armed: 1", "armed is 1; allowed: true or false"),
        ("sense: Left", "sense is 'Left'; allowed: 'left', 'right'; did you mean 'left'?"),
        ("wind: strong", "wind is 'strong'; allowed: a number or a mapping with mean, peak"),
        ("wind: {mean: 3, peak: 1}", "wind: peak must be at least mean"),
        ("target: {speed: 1}", "'kind' is missing in 'target'; needed: 'fixed', 'walk'"),
        ("target: {kind: walk, speed: 11}", "target.speed is 11; allowed: a number > 0 and ≤ 10"),
        (
            "target: {kind: fixed, at: [1, 2]}",
            "target.at is a list of 2; allowed: a list of 3, each a number",
        ),
        ("labels: {eleven: a}", "key 'eleven' in 'labels': Input should be a valid integer"),
        ("labels: {11: 5}", "labels.11 is 5; allowed: text; write '5' in quotes"),
        ("<<: {gain: 2}", "merge key '<<' is not supported; write the keys out"),
        ("gain: !!float 2", "tag 'tag:yaml.org,2002:float' is not allowed; allowed: plain values"),
        ("gain: *other", "alias 'other' names no finished value above it"),
        ("? [a]\n: 2", "a key must be a word"),
        ("~: 2", "a key must be a word"),
        ("...\n---\ngain: 2", "a second document; allowed: one in a file"),
        ("\tgain: 2", "not YAML: while scanning"),
        ('gain: "\\UFFFFFFFF"', "a number or character code that does not exist"),
        ('name2: "\\ud800"', "half of a surrogate pair is no character"),
    ],
)
def test_each_fault_says_what_is_wrong_and_what_is_allowed(line: str, said: str) -> None:
    told = faults(base(line))
    assert any(said in one for one in told), told
    assert all(int(one.split(":")[0]) >= 3 or "twice" in one for one in told)


def test_text_stays_text() -> None:
    for word in ("on", "no", "yes", "1:30", "2001-01-01", "010", "1_000", "nan", "'12'", "'true'", '"~"'):
        assert read(base().replace("name: n", f"name: {word}").encode(), "f", Flight).name == word.strip(
            "'\""
        )


def test_the_nearest_member_of_a_union_is_blamed() -> None:
    assert faults(base("wind: {mean: 3, pek: 1}")) == [
        "3:1: 'peak' is missing in 'wind'; needed: a number ≥ 0",
        "3:17: 'pek' is unknown; allowed: mean, peak; did you mean 'peak'?",
    ]


def test_an_alias_stands_for_its_value_and_is_blamed_where_that_stands() -> None:
    flight = read(base("wind: &w {mean: 1, peak: 2}", "parts: [*w, *w]").encode(), "f", Flight)
    assert flight.parts == [flight.wind, flight.wind]
    assert faults(base("wind: &w {mean: 1, peak: -2}", "parts: [*w]")) == [
        "3:26: parts[0].peak is -2; allowed: a number ≥ 0",
        "3:26: wind.peak is -2; allowed: a number ≥ 0",
    ]


@pytest.mark.parametrize("empty", ["", "\n", "# nothing\n", "\ufeff"])
def test_an_empty_file_says_what_it_needs(empty: str) -> None:
    (line,) = faults(empty)
    assert line.startswith("1:1: ")
    assert "name, vehicles" in line


@pytest.mark.parametrize("top", ["- 1", "word", "12", "''"])
def test_only_a_mapping_is_a_configuration(top: str) -> None:
    (line,) = faults(top)
    assert line.startswith(
        "1:1: is no mapping; needed: a mapping with name, vehicles, optionally with period_us"
    )


def test_bytes_that_are_not_utf_8_are_placed() -> None:
    assert faults("name: é\ngain: ".encode() + b"\xff\n") == [
        "2:7: byte 0xff is not UTF-8; allowed: text in UTF-8"
    ]
    assert faults(b"\xef\xbb\xbfa\xff") == ["1:2: byte 0xff is not UTF-8; allowed: text in UTF-8"]
    assert faults("name: ab\nx\0")[0] == "2:2: character U+0000 is not allowed"


def test_laughs_depth_size_and_crowds_are_bounded() -> None:
    laughs = ["a: &a [x, x, x, x, x, x, x, x, x, x]"]
    laughs += [
        f"{b}: &{b} [{', '.join(['*' + a] * 10)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    ]
    assert "too much, aliases expanded" in faults("\n".join(laughs))[0]
    ladder = [
        "a: &a [[[[[[[[x]]]]]]]]",
        *(
            f"{b}: &{b} [*{a}]"
            for a, b in zip("abcdefghijklmnopqrstuvwxy", "bcdefghijklmnopqrstuvwxyz", strict=True)
        ),
    ]
    assert "nested too deeply by an alias" in faults("\n".join(ladder))[0]
    assert "nested too deeply" in faults("[" * 5000)[0]
    assert "nested too deeply" in faults("- " * 5000)[0]
    assert faults(b"#" * (MOST_BYTES + 1)) == [f" larger than {MOST_BYTES} bytes, the most allowed"]
    crowd = faults("".join(f"k{i}: 1\n" for i in range(3000)))
    assert len(crowd) == MOST_FAULTS + 1
    assert crowd[-1] == f" and {3002 - MOST_FAULTS} more faults"


def test_what_is_no_file_says_what_is_near(tmp_path: Path) -> None:
    (tmp_path / "escort.yaml").write_text(GOOD)
    (tmp_path / "walk.yaml").write_text(GOOD)
    for path, said in (
        (tmp_path / "wakl.yaml", "no such file; there is walk.yaml, escort.yaml"),
        (tmp_path / "gone" / "walk.yaml", f"no such file, nor a folder {tmp_path / 'gone'}"),
        (tmp_path, "not a file; allowed: a YAML file"),
        (tmp_path / ("n" * 300), "cannot be read: File name too long"),
    ):
        with pytest.raises(InputError) as caught:
            load(path, Flight)
        assert str(caught.value) in (
            f"{path}: {said}",
            f"{path}: no such file; there is escort.yaml, walk.yaml",
        )
        assert caught.value.exit_status == 2


def test_a_fault_is_one_line_that_cannot_steer_a_terminal() -> None:
    error = InputError(Fault("a\nb", "bad \x1b[31m", 3, 4), "a plain\rword")
    assert str(error) == "a\\nb:3:4: bad \\x1b[31m\na plain\\rword"


# Laws


@given(st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False))
def test_what_json_calls_a_number_is_that_number(number: float) -> None:
    found = resolve(json.dumps(number))
    assert found == number
    assert type(found) is type(number)


@given(st.text(max_size=30) | st.from_regex(r"[-+.0-9eExob_:]{1,30}", fullmatch=True))
def test_a_plain_scalar_is_itself_or_a_finite_value(word: str) -> None:
    try:
        found = resolve(word)
    except ScalarError:
        return
    assert found == word if isinstance(found, str) else found is None or math.isfinite(found)


NUMBERS = st.floats(-1e300, 1e300)
GUSTS = st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 100.0)).map(lambda t: Gust(mean=min(t), peak=max(t)))
WORDS = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), max_size=20)
FLIGHTS = st.builds(
    Flight,
    name=WORDS,
    vehicles=st.integers(1, 244),
    period_us=st.integers(1, 10_000).map(lambda n: 4 * n),
    gain=NUMBERS,
    armed=st.booleans(),
    sense=st.sampled_from(Sense),
    target=st.none()
    | st.builds(Fixed, kind=st.just("fixed"), at=st.tuples(NUMBERS, NUMBERS, NUMBERS))
    | st.builds(Walk, kind=st.just("walk"), speed=st.floats(0.1, 10.0)),
    wind=NUMBERS | GUSTS,
    marks=st.lists(NUMBERS, max_size=3).map(tuple),
    labels=st.dictionaries(st.integers(-99, 99), WORDS, max_size=3),
    parts=st.lists(GUSTS, max_size=2),
)


@given(FLIGHTS)
def test_what_is_written_is_read(flight: Flight) -> None:
    assert read(flight.model_dump_json(indent=1).encode(), "f", Flight) == flight


def check_bytes(data: bytes) -> None:
    """A document is a value, or InputError whose places lie in it."""
    try:
        read(data, "f.yaml", Flight)
    except InputError as error:
        lines = data.decode(errors="replace").removeprefix("\ufeff").split("\n")
        assert len(str(error).split("\n")) == len(error.faults) > 0  # noqa: PT017
        for fault in error.faults:
            assert isinstance(fault, Fault)
            if fault.line is not None and fault.column is not None:
                assert 1 <= fault.line <= len(lines)
                assert 1 <= fault.column <= len(lines[fault.line - 1]) + 1


@given(st.binary(max_size=200))
@example(b"\xef\xbb\xbf\xff")
@example(b"a: \xe2\x80\xa8\nb: [")
def test_any_bytes_are_a_value_or_an_input_error(data: bytes) -> None:
    check_bytes(data)


WORDY = [
    ": ",
    "- ",
    "? ",
    ", ",
    "|\n",
    ">-\n",
    "---\n",
    "...\n",
    "&a ",
    "*a",
    "!!set ",
    "<<",
    ".nan",
    "1e400",
]
TOKENS = st.sampled_from([*"[]{}#!'~\\\"\n\t\r\0\x85\u2028", "\n  ", "\\ud800", "0x", "%YAML 1.1\n", *WORDY])
FRAGMENTS = st.sampled_from([*GOOD.split(), *GOOD.splitlines(keepends=True)])


@given(st.lists(TOKENS | FRAGMENTS, max_size=40).map("".join) | st.text(max_size=100))
@example("name: &a [*a]")
@example("a:\n" + "\x85" * 5 + "[")
def test_any_text_is_a_value_or_an_input_error(document: str) -> None:
    check_bytes(document.encode(errors="surrogatepass"))


@given(
    st.lists(
        st.tuples(st.integers(0, len(GOOD)), st.integers(0, 6), TOKENS | FRAGMENTS | st.just("")),
        min_size=1,
        max_size=4,
    )
)
def test_a_good_file_gone_wrong_is_a_value_or_an_input_error(edits: list[tuple[int, int, str]]) -> None:
    document = GOOD
    for at, length, put in edits:
        document = document[:at] + put + document[at + length :]
    check_bytes(document.encode())


# Schemas


def test_a_schema_names_its_dialect_and_is_the_same_each_time() -> None:
    assert schema(Flight)["$schema"].startswith("https://json-schema.org/")
    assert json.loads(text(Flight)) == schema(Flight)
    assert text(Flight) == text(Flight)


def test_a_file_names_its_schema_as_seen_from_itself() -> None:
    line = schema_line(Path("config/scenarios/escort.yaml"), Path("config/schemas"), "scenario")
    assert line == "# yaml-language-server: $schema=../schemas/scenario.json"
