"""A sample of any content class fits its class, and travels; what cannot have one is told."""

from enum import StrEnum
from typing import Annotated, Literal

import msgspec
import pytest

from agent_runtime.testing.samples import NoSample, sample, sample_named
from companion.design import LANGUAGES


class Colour(StrEnum):
    """One of two."""

    RED = "red"
    BLUE = "blue"


class Inner(msgspec.Struct, frozen=True, tag=True):
    """A part."""

    size: Annotated[float, msgspec.Meta(gt=1.0)]


class Outer(msgspec.Struct, frozen=True, tag=True):
    """A whole with a part of each kind."""

    inner: Inner
    colour: Colour
    word: Literal["a", "b"]
    pair: tuple[int, str]
    many: tuple[Inner, ...]
    maybe: Inner | None
    kept: int = 7


CLASSES = [
    f"{name}.{kind.__name__}"
    for name in LANGUAGES.names
    for kind in sorted(LANGUAGES.named(name).classes, key=lambda kind: kind.__name__)
]


@pytest.mark.parametrize("name", CLASSES)
def test_every_class_of_the_companion_has_a_sample_that_travels(name):
    """Encoded and decoded by its language it is the same."""
    made = sample_named(LANGUAGES, name)
    language = LANGUAGES.named(name.partition(".")[0])
    assert language.decode(language.encode(made)) == made


def test_fields_of_each_kind_are_filled_and_defaults_are_kept():
    """Bounds of numbers hold, the first word and the first colour are taken, None where it may
    be.
    """
    made = sample(Outer)
    assert made == Outer(Inner(2.0), Colour.RED, "a", (0, "x"), (), None)
    assert made.kept == 7


def test_what_has_no_plain_value_is_told():
    """A text that must have a pattern cannot be guessed."""
    kind = msgspec.defstruct("Odd", [("code", Annotated[str, msgspec.Meta(pattern=r"^[0-9]{4}$")])])
    with pytest.raises(NoSample, match="make one by hand"):
        sample(kind)
