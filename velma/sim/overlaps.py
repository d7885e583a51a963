"""Things of a scene that stand in each other or in the robot. Read from the contacts of the simulation at its start."""

import mujoco

from velma.errors import SceneError
from velma.model.scene import Scene

MOST_M = (
    0.003  # [m] estimate: a recorded scene is true to some millimetres, and what stands is pressed in by less than 1
)


def refuse(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Raise SceneError if a thing overlaps another one or the robot by more than MOST_M.

    `data` has the contacts of the start posture. Furniture may overlap furniture: it does not move.
    """
    things = {thing.id for thing in scene.things}
    for contact in data.contact[: data.ncon]:
        if contact.dist >= -MOST_M:
            continue
        first, second = (model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom)
        named = [name for name in (first, second) if name in things]
        if not named or any(name.startswith("grain_") for name in (first, second)):
            continue
        other = second if first == named[0] else first
        around = other if other in things else ("the floor" if other == "world" else f"the robot ({other})")
        deep = f"{-1000 * contact.dist:.0f} mm inside {around}"
        raise SceneError(
            f"thing {named[0]}", deep, f"things that overlap by at most {1000 * MOST_M:.0f} mm; move one of them"
        )
