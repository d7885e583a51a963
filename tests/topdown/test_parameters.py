"""Parameters of a design: what a person types is checked against type, bounds and choices, and
refused in words.
"""

import pytest

from topdown.model.elements import Agent, Parameter, ParameterType
from topdown.model.errors import NoSuchParameter, ParameterError
from topdown.model.parameters import Parameters, worded

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
