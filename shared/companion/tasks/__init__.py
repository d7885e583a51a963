"""The robot's tasks, one folder each, with the parts that a task needs.

`command` (ROW) with `phrases.toml`: what a person may ask; a task without it is only a part of
others' plans. `plan` (PLAN): methods and steps, for pl alone. `perform` (SKILLS): its skill, for ex
alone. `done` (ACTS, SHOWN): the class of its act, what must be true after it, and how tools show
it. `sentences.toml`: how people read it. `verdict` (JUDGE): whether it was done in truth, for tools
alone. A part is imported when it is asked for, so that an agent needs the libraries of its own
parts only. A task imports no other task; it refers to one by name.
"""

import pkgutil
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

NAMES = tuple(sorted(one.name for one in pkgutil.iter_modules(__path__) if one.ispkg))


@cache
def parts(part: str) -> tuple[ModuleType, ...]:
    """This part of each task that has it, in the order of the tasks' names."""
    names = (f"{__name__}.{task}.{part}" for task in NAMES)
    return tuple(import_module(name) for name in names if find_spec(name))
