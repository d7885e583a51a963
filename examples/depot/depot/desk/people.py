"""The people at the desk, pretended: they want what an orders file says, one wish after the other.

After a death of the desk they say everything again; the number of a wish tells which were heard
before.
"""

import tomllib
from pathlib import Path
from typing import Any

import msgspec
from agent_runtime.io.devices import DeviceMaker, Post

ORDERS = Path(__file__).parents[1] / "orders.toml"


class Wish(msgspec.Struct, frozen=True):
    """Somebody wants this carried; `at_s`: seconds after the desk's start."""

    item: str
    source: str
    target: str
    at_s: float = 0.0
    number: int = 0


def read(path: Path | None) -> tuple[Wish, ...]:
    """The wishes in an orders file, numbered from 1. Raises msgspec.ValidationError, which says
    what does not fit.
    """
    orders = tomllib.loads((path or ORDERS).read_text(encoding="utf-8")).get("order", [])
    wishes = msgspec.convert(orders, tuple[Wish, ...])
    return tuple(msgspec.structs.replace(wish, number=number) for number, wish in enumerate(wishes, start=1))


class People:
    """The device: says each wish when it is time, and hears nothing."""

    busy = False

    def __init__(self, post: Post, wishes: tuple[Wish, ...]) -> None:
        for wish in wishes:
            post(wish, wish.at_s)

    def tell(self, content: Any) -> None:
        """Nothing is told."""

    def close(self) -> None:
        """Nothing to close."""


def people(wishes: tuple[Wish, ...]) -> DeviceMaker:
    """People who want this."""
    return lambda post: People(post, wishes)
