"""Back-ends by name: `package.module:function`, or a short name of one that comes with the
executor.

The function takes nothing, or the scene (velma.model.scene.Scene) if it is a simulator. The current
folder is searched last, after everything that is installed.
"""

import importlib
import inspect
import sys
from collections.abc import Callable
from pathlib import Path

from velma.errors import BackendError, NoRobotError
from velma.model.scene import Scene
from velma.sim.backend import Backend, State

SHORT = {
    "mujoco": "velma.sim.mujoco_backend:MujocoBackend",
    "mock": "velma.sim.mock_backend:MockBackend",
}
PARTS = ("period_s", "observe", "step", "configuration", "work_J")


def maker(name: str, scene: Scene) -> Callable[[], Backend]:
    """Return the function that makes the back-end of this name. BackendError where there is no such
    function, or where it makes none.
    """
    package, _, function = SHORT.get(name, name).partition(":")
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))
    try:
        found = getattr(importlib.import_module(package), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise BackendError(name, str(error), *_wanted()) from None
    if not callable(found):
        raise BackendError(name, f"{function} is of type {type(found).__name__}", *_wanted())
    arguments = (scene,) if _parameters(found) else ()
    return lambda: _checked(name, lambda: found(*arguments))


def _wanted() -> tuple[str, str]:
    names = ", ".join(SHORT)
    return (
        f"package.module:function, a function that makes a back-end, or a short name ({names})",
        "mend the name; put the package into the current folder or install it",
    )


def _parameters(found: Callable[..., Backend]) -> bool:
    """Whether the function has an argument without a default."""
    try:
        return any(
            each.default is each.empty for each in inspect.signature(found).parameters.values()
        )
    except ValueError:  # a class in C without a signature
        return False


def _checked(name: str, make: Callable[[], Backend]) -> Backend:
    right = "a velma.sim.backend.Backend"
    try:
        made = make()
    except Exception as error:  # of anybody's code: there is no robot
        told = f"it raised {type(error).__name__}: {error}"
        raise NoRobotError(
            name, told, right, "see whether the robot answers, and what its function does"
        ) from error
    missing = [part for part in PARTS if not hasattr(made, part)]
    if missing:
        kind = f"it made a {type(made).__name__} without {', '.join(missing)}"
        raise BackendError(name, kind, right, "add what is missing (docs/back-ends.md)")
    if not isinstance(state := made.observe(), State):
        told = f"observe() returned a {type(state).__name__}"
        state_there = "a velma.sim.backend.State"
        raise BackendError(name, told, state_there, "fill the one of at_rest() (docs/back-ends.md)")
    return made
