"""Orders of an operator to one agent while it runs: pause and resume, log level, values of its
parameters.

An order is an event like any other: it is journalled before it counts, and replayed with the rest
of the log. What was set is kept over a restart of the agent until it is set again. Must not know:
which parameters there are, and the wire.
"""

from collections.abc import Mapping
from typing import Protocol

import msgspec

KIND = "control"
"""The signal on which orders travel: from its owner, the operator, to the agent that is its
peer.
"""
LEVELS = ("debug", "info", "warning", "error")
Value = bool | int | float | str


class Pause(msgspec.Struct, frozen=True, tag=True):
    """Take no step until Resume: whatever comes waits in the inbox, up to its bound."""


class Resume(msgspec.Struct, frozen=True, tag=True):
    """Go on with what waits."""


class SetLevel(msgspec.Struct, frozen=True, tag=True):
    """Show log lines of this level and above; the file has everything."""

    level: str


class SetParameter(msgspec.Struct, frozen=True, tag=True):
    """Give a parameter of the design another value."""

    name: str
    value: Value


Order = Pause | Resume | SetLevel | SetParameter


class Command(msgspec.Struct, frozen=True):
    """An order as it travels. `id`: by which the answer names it; a copy changes nothing."""

    id: str
    order: Order


class Answer(msgspec.Struct, frozen=True):
    """Result of the command `id`: obeyed, or refused with the reason `why`."""

    id: str = ""
    why: str = ""


class Settings(msgspec.Struct, frozen=True, omit_defaults=True):
    """Settings made by orders, kept in the journal. `level` "": as the process was started;
    `parameters`: those set.
    """

    paused: bool = False
    level: str = ""
    parameters: dict[str, Value] = {}


NOTHING_SET = Settings()


class Parameters(Protocol):
    """The parameters of an agent in its design; topdown.model.parameters reads them."""

    @property
    def defaults(self) -> Mapping[str, Value]:
        """The value of each parameter that nobody has set."""

    def fitted(self, name: str, value: Value) -> Value:
        """The value in the parameter's type. Raise ValueError where it does not fit, with what
        would.
        """


def obeyed(settings: Settings, order: Order, parameters: Parameters | None) -> Settings:
    """The settings after an order. Raise ValueError where it cannot be obeyed, with the reason."""
    match order:
        case Pause() | Resume():
            return msgspec.structs.replace(settings, paused=isinstance(order, Pause))
        case SetLevel(level=level):
            if level not in LEVELS:
                raise ValueError(f"log level {level!r} is none of {', '.join(LEVELS)}")
            return msgspec.structs.replace(settings, level=level)
        case SetParameter(name=name, value=value):
            if parameters is None:
                raise ValueError(
                    f"parameter {name!r} is not there; the design gives this agent none"
                )
            fitting = parameters.fitted(name, value)
            return msgspec.structs.replace(
                settings, parameters={**settings.parameters, name: fitting}
            )


def values(
    settings: Settings, parameters: Parameters | None
) -> tuple[dict[str, Value], tuple[str, ...]]:
    """The value of each parameter, and the names whose kept value does not fit the design any
    more.
    """
    found, unfit = dict(parameters.defaults) if parameters is not None else {}, []
    for name, value in settings.parameters.items():
        try:
            if parameters is not None:
                found[name] = parameters.fitted(name, value)
        except ValueError:
            unfit.append(name)
    return found, tuple(unfit)


def worded(order: Order) -> str:
    """An order in words."""
    match order:
        case SetLevel(level=level):
            return f"log level {level}"
        case SetParameter(name=name, value=value):
            return f"{name} = {value}"
        case _:
            return type(order).__name__.lower()
