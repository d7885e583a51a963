"""Whether the parameters of agents can be: defaults and choices that fit, bounds that make sense, a key to set them."""

from collections.abc import Iterator

from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import ParameterError
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_
from topdown.model.parameters import COUNTABLE, Parameters

SIGNAL = "control"
"""The kind of signal by which parameters are set."""


def findings(design: Design) -> Iterator[Finding]:
    """Parameters that nobody could set, or that no value fits."""
    readers = {name for signal in design.signals.values() if signal.kind == SIGNAL for name in signal.readers}
    for index, agent in enumerate(design.file.agent):
        if agent.parameter and agent.name not in readers:
            wrong = f"has parameters, but reads no [[signal]] of kind {SIGNAL!r}, so nobody can set them"
            yield Finding(Kind.PARAMETER, f"agent {agent.name}", wrong, "name it among the readers", ("agent", index))
        for number, entry in enumerate(agent.parameter):
            yield from _of(agent, entry, ("agent", index, "parameter", number))


def _of(agent: elements.Agent, entry: elements.Parameter, at: Path_) -> Iterator[Finding]:
    where = f"agent {agent.name}, parameter {entry.name}"
    least, most = entry.least, entry.most
    if (least is not None or most is not None) and entry.type not in COUNTABLE:
        yield Finding(Kind.PARAMETER, where, f"a {entry.type.value} has bounds", "leave least and most out", at)
        return
    if least is not None and most is not None and least > most:
        yield Finding(Kind.PARAMETER, where, f"least {least:g} is above most {most:g}", "exchange them", at)
        return
    for field, values in (("default", (entry.default,)), ("choices", entry.choices)):
        for value in values:
            try:
                Parameters(agent).fitted(entry.name, value)
            except ParameterError as error:
                yield Finding(Kind.PARAMETER, where, f"{field} is {value!r}", f"it must be {error.right}", (*at, field))
                return
