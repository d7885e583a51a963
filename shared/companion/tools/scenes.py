"""Whether the loop can be started with a scene and a seed, asked before anything is started."""

from pathlib import Path

LOOP = "loop"
"""The process that has the robot in its scene."""


def possible(names: tuple[str, ...], scene: str, seed: int) -> None:
    """Load a scene as the loop will, varied by the seed. Raise ValueError that says what cannot be.

    `names`: the processes that are to be started. The canonical scene, for which no file is named,
    is one for every seed.
    """
    if not scene or LOOP not in names:
        return
    # numpy: half of a start's time, and most starts name no scene
    from velma.errors import SceneError
    from velma.model import scene as scenes
    from velma.sim.mujoco_backend import MujocoBackend

    try:
        MujocoBackend(scenes.vary(scenes.load(Path(scene)), seed))
    except (SceneError, OSError) as error:
        raise ValueError(str(error) if scene in str(error) else f"{scene}: {error}") from error
