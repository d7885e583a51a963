"""agent_runtime.core.binding for this system: agents and wirings of design.toml, in the languages
of this room.

Must not know: what any agent does, Zenoh. The only module of this room that sees agent_runtime, and
only its tables.
"""

from collections.abc import Mapping
from typing import Any, TypeVar

from agent_runtime.core import binding
from agent_runtime.core.agent import Agent
from agent_runtime.core.binding import BindingError, Condition, Takes, Transition
from agent_runtime.core.wiring import Wiring
from companion.all_languages import LANGUAGES
from companion.design import DESIGN
from topdown.model.design import Design

__all__ = ["BindingError", "Condition", "Takes", "Transition", "bind", "wiring"]

M = TypeVar("M")


def bind(
    name: str,
    memory: M,
    behaviours: Mapping[str, Transition[M]],
    conditions: Mapping[str, Condition[M]],
    *,
    takes: Mapping[str, Takes[M]] | None = None,
    local: Any = None,
    design: Design = DESIGN,
) -> Agent[M]:
    """The agent `name` of the design; see agent_runtime.core.binding.bind."""
    return binding.bind(
        name, memory, behaviours, conditions, design=design, takes=takes, local=local
    )


def wiring(name: str, system: str, design: Design = DESIGN) -> Wiring:
    """All links of the agent `name` in the system called `system` (the prefix of its keys)."""
    return binding.wiring(name, system, design=design, languages=LANGUAGES)
