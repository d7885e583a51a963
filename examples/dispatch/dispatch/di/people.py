"""People who order, pretended: they want what the file of orders says.

After a death of di they say everything again; the number of an order tells which were heard before.
"""

from typing import Any

import msgspec
from agent_runtime.io.devices import DeviceMaker, Post
from companion.design import AnyCommand

from dispatch.orders import Order


class Wanted(msgspec.Struct, frozen=True):
    """Somebody wants this done."""

    number: int
    task: AnyCommand


class People:
    """The device: says each order when it is time, and hears nothing."""

    busy = False

    def __init__(self, post: Post, orders: tuple[Order, ...]) -> None:
        for number, order in enumerate(orders, start=1):
            post(Wanted(number, order.task), order.at_s)

    def tell(self, content: Any) -> None:
        """Nothing is told."""

    def close(self) -> None:
        """Nothing to close."""


def people(orders: tuple[Order, ...]) -> DeviceMaker:
    """People who want this."""
    return lambda post: People(post, orders)
