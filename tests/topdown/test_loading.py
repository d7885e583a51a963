"""A design file that is wrong is refused with the place, what is wrong and what would be right."""

from pathlib import Path

import pytest

from topdown.check import check
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.elements import CHANGES, Agent, Parameter, ParameterType
from topdown.model.errors import DesignError, NoSuchParameter, ParameterError
from topdown.model.findings import Kind
from topdown.model.parameters import Parameters, worded

SMALL = Path(__file__).with_name("lamp.toml").read_text()


def line_of(text: str, part: str) -> int:
    """Line number of the first line with this text."""
    return next(number for number, line in enumerate(text.splitlines(), start=1) if part in line)


def test_a_good_file_is_read() -> None:
    """Every entry is there, typed."""
    file = loading.read(SMALL)
    assert file.protocol[0].message[1].performative.value == "inform"
    assert file.step[0].divide is not None


def test_a_wrong_value_is_named_with_its_line() -> None:
    """The error has file, line, field and the type wanted."""
    for old, new, field, right in (
        ("durable = true", 'durable = "yes"', "protocol[0].durable", "it must be true or false"),
        (
            'performative = "inform"',
            'performative = "shout"',
            "protocol[0].message[1].performative",
            "Performative",
        ),
        (
            "bytes = 100\n\n[[agent]]",
            "bytes = 1.5\n\n[[agent]]",
            "protocol[0].message[1].bytes",
            "it must be an integer",
        ),
        ('text = "switch a lamp"', "text = 3", "requirement[0].text", "it must be text"),
        ('root = "all"', "root = 1", "system.root", "it must be text"),
        (
            'into = ["hand", "lamp"]',
            'into = ["hand", "lamp", "cord"]',
            "step[0].divide.into",
            "exactly two halves: write into = [",
        ),
        (
            'between = ["hand", "lamp"]',
            'between = ["hand", "lamp", "cord"]',
            "step[0].channels[0].between",
            "it must be a list of exactly 2: each text",
        ),
        ('requirements = ["R1"]', "requirements = [1]", "step[0].requirements[0]", "be text"),
    ):
        text = SMALL.replace(old, new)
        with pytest.raises(DesignError) as caught:
            loading.read(text, "lamp.toml")
        error, line = caught.value, line_of(text, new.splitlines()[0])
        assert (error.file, error.field, error.line) == ("lamp.toml", field, line)
        assert right in error.right, new
        assert f"lamp.toml:{line}" in str(error)


def test_a_misspelt_field_names_the_fields_there_are() -> None:
    """Unknown fields are errors, and the known ones are listed."""
    text = SMALL.replace("participant =", "participent =")
    with pytest.raises(DesignError) as caught:
        loading.read(text)
    assert "participent" in caught.value.wrong
    assert "participant" in caught.value.right
    assert caught.value.line == line_of(text, "participent")


def test_an_entry_that_has_another_name_now_is_told_that_name() -> None:
    """With its line: a design that was written before is mended by one word."""
    with pytest.raises(DesignError, match="it is gone"):
        loading.read(SMALL + '[[claim]]\nname = "bytes"\n')
    with pytest.raises(DesignError) as caught:
        loading.read(SMALL + '[[house]]\nkind = "alive"\n')
    assert (caught.value.line, caught.value.right) == (
        SMALL.count("\n") + 1,
        "it is called [[signal]] now",
    )


def test_a_file_of_an_older_format_is_read_and_told_what_changed() -> None:
    """By one finding, at [system], which says what to write."""
    text = SMALL.replace("format = 2\n\n", "")
    (finding,) = check(Design(loading.read(text), "lamp.toml", text))
    assert (finding.kind, finding.line) == (Kind.OLD_FORMAT, line_of(text, "[system]"))
    assert CHANGES[2] in finding.wrong
    assert "`format = 2`" in finding.right


def test_a_format_that_is_not_known_is_refused() -> None:
    """Before whatever else a newer file has."""
    for number in ("0", "3", '"2"'):
        with pytest.raises(DesignError) as caught:
            loading.read(SMALL.replace("format = 2", f"format = {number}\nnewer = 1"))
        assert (caught.value.field, caught.value.line) == ("format", line_of(SMALL, "format = 2"))
        assert "formats 1 to 2" in caught.value.right


def test_a_missing_field_points_at_its_entry() -> None:
    """The line is that of the entry that lacks it."""
    text = SMALL.replace('sender = "lamp"\n', "")
    with pytest.raises(DesignError) as caught:
        loading.read(text)
    assert "sender" in caught.value.wrong
    entry = text.splitlines()[caught.value.line - 1 if caught.value.line else 0]
    assert entry == "[[protocol.message]]"


def test_what_is_no_toml_is_named_with_its_line() -> None:
    """Syntax errors carry the line as well."""
    text = SMALL.replace("durable = true", "durable = ")
    with pytest.raises(DesignError) as caught:
        loading.read(text)
    assert caught.value.line == line_of(text, "durable =")


def test_a_file_is_read_from_its_path(tmp_path: Path) -> None:
    """`load` reads what `read` reads."""
    path = tmp_path / "design.toml"
    path.write_text(SMALL)
    assert loading.load(path) == loading.read(SMALL)


# --- Parameters of a design: what a person types is checked against type, bounds and choices, and
# refused in words


ENTRIES = (
    Parameter("tries", ParameterType.INTEGER, 3, "", least=1, most=9),
    Parameter("speed", ParameterType.NUMBER, 1, "", least=0.5, unit="m/s"),
    Parameter("calm", ParameterType.BOOLEAN, False, ""),
    Parameter("side", ParameterType.TEXT, "left", "", choices=("left", "right")),
)
MULE = Parameters(Agent("mule", parameter=ENTRIES))


def test_what_fits_is_read_in_its_type() -> None:
    """And said again as it was typed, but for capitals."""
    for name, text, value in (
        ("tries", "9", 9),
        ("speed", "2", 2.0),
        ("speed", "0.5", 0.5),
        ("calm", "True", True),
        ("side", "right", "right"),
    ):
        read = MULE.read(name, text)
        assert (read, type(read), worded(read)) == (value, type(value), text.lower())


def test_what_does_not_fit_is_told_with_what_would() -> None:
    """By the name of the parameter and its agent."""
    for name, text, right in (
        ("tries", "10", "an integer from 1 to 9"),
        ("tries", "0", "an integer from 1 to 9"),
        ("tries", "2.5", "an integer from 1 to 9"),
        ("speed", "0.4", r"a number of at least 0.5 \[m/s\]"),
        ("speed", "inf", r"a number of at least 0.5 \[m/s\]"),
        ("calm", "1", "true or false"),
        ("side", "up", "one of left, right"),
    ):
        with pytest.raises(
            ParameterError, match=f"{name} of mule cannot be '{text}'; it is {right}"
        ):
            MULE.read(name, text)


def test_a_parameter_that_is_not_there_is_told_with_those_that_are() -> None:
    """Of an agent without any, too."""
    with pytest.raises(
        NoSuchParameter, match="no parameter 'x'; its parameters: tries, speed, calm, side"
    ):
        MULE.read("x", "1")
    with pytest.raises(NoSuchParameter, match="its parameters: none"):
        Parameters(Agent("ox")).entry("x")


def test_a_number_is_a_number_though_its_default_is_written_without_a_point() -> None:
    """So a behaviour that reads it as float may."""
    assert type(MULE.defaults["speed"]) is float
