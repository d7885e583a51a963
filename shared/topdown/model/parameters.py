"""Parameters of an agent: values that an operator may set while it runs, each with its type,
default and bounds.

They stand in the design file (elements.Parameter). Who sets one and the agent that takes it check
it by the same words.
"""

from functools import cached_property

from topdown.model.elements import Agent, Parameter, ParameterType
from topdown.model.errors import NoSuchParameter, ParameterError

Value = bool | int | float | str
_ARTICLE = {
    ParameterType.INTEGER: "an integer",
    ParameterType.NUMBER: "a number",
    ParameterType.TEXT: "a text",
    ParameterType.BOOLEAN: "true or false",
}
_TRUTH = {"true": True, "false": False}
COUNTABLE = (ParameterType.INTEGER, ParameterType.NUMBER)
"""Types that may have bounds."""


class Parameters:
    """The parameters of one agent."""

    def __init__(self, agent: Agent) -> None:
        self.agent = agent.name
        self.entries = {entry.name: entry for entry in agent.parameter}

    @cached_property
    def defaults(self) -> dict[str, Value]:
        """The value of each parameter that nobody has set."""
        return {name: _default(entry) for name, entry in self.entries.items()}

    def entry(self, name: str) -> Parameter:
        """The parameter of this name. Raises NoSuchParameter, which lists those there are."""
        if name not in self.entries:
            raise NoSuchParameter(self.agent, name, self.entries)
        return self.entries[name]

    def fitted(self, name: str, value: Value) -> Value:
        """A value in the parameter's type. Raises ParameterError where it does not fit."""
        entry = self.entry(name)
        if not _typed(entry.type, value) or not _within(entry, value):
            raise ParameterError(self.agent, name, value, allowed(entry))
        return float(value) if entry.type is ParameterType.NUMBER else value

    def read(self, name: str, text: str) -> Value:
        """The value that a person typed. Raises ParameterError where it does not fit."""
        entry = self.entry(name)
        try:
            return self.fitted(name, _parsed(entry.type, text))
        except (ValueError, KeyError) as error:
            raise ParameterError(self.agent, name, text, allowed(entry)) from error


def allowed(entry: Parameter) -> str:
    """The values a parameter may have, in words: type, bounds or choices, unit."""
    words = _ARTICLE[entry.type]
    if entry.choices:
        return f"one of {', '.join(map(worded, entry.choices))}"
    if entry.least is not None and entry.most is not None:
        words += f" from {entry.least:g} to {entry.most:g}"
    elif entry.least is not None:
        words += f" of at least {entry.least:g}"
    elif entry.most is not None:
        words += f" of at most {entry.most:g}"
    return f"{words} [{entry.unit}]" if entry.unit else words


def worded(value: Value) -> str:
    """A value as a person types it."""
    return (
        str(value).lower()
        if isinstance(value, bool)
        else f"{value:g}"
        if isinstance(value, float)
        else str(value)
    )


def _default(entry: Parameter) -> Value:
    whole = entry.type is ParameterType.NUMBER and not isinstance(entry.default, bool | str)
    return float(entry.default) if whole else entry.default


def _parsed(kind: ParameterType, text: str) -> Value:
    match kind:
        case ParameterType.INTEGER:
            return int(text)
        case ParameterType.NUMBER:
            return float(text)
        case ParameterType.BOOLEAN:
            return _TRUTH[text.lower()]
    return text


def _typed(kind: ParameterType, value: object) -> bool:
    """Whether a value is of this type; true is not a number, and a number of a parameter is
    finite.
    """
    if isinstance(value, bool):
        return kind is ParameterType.BOOLEAN
    if isinstance(value, int):
        return kind in COUNTABLE
    if isinstance(value, float):
        return kind is ParameterType.NUMBER and value - value == 0.0
    return kind is ParameterType.TEXT and isinstance(value, str)


def _within(entry: Parameter, value: Value) -> bool:
    if entry.choices and value not in entry.choices:
        return False
    if isinstance(value, str):
        return True
    least, most = entry.least, entry.most
    return (least is None or value >= least) and (most is None or value <= most)
