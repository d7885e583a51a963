"""A scene: things and their poses, contents, noise of observations. Read from TOML, varied by a seed.

Ids are those that the agents use (jar_1, bowl_1, cabinet_2, table_1, ...). A scene may lack any of them. Knows no
physics: scene_xml.py writes a scene as MJCF.
"""

import math
from enum import StrEnum
from pathlib import Path

import msgspec
import numpy as np

from velma.errors import SceneError

CANONICAL = Path(__file__).parent / "scenes" / "canonical.toml"

Vector = tuple[float, float, float]


class Model(StrEnum):
    """Models of objects.yaml that a thing can be."""

    JAR = "jar"
    BOWL = "bowl"
    CABINET = "cabinet"
    TABLE = "table"
    BOX1 = "box1"
    BOX2 = "box2"
    BOX3 = "box3"


BOXES = (Model.BOX1, Model.BOX2, Model.BOX3)
MOVEABLE = (Model.JAR, Model.BOWL, *BOXES)


class Thing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A thing upright in the world: position [m] of its model's origin, yaw [rad], and the cabinet it moves with."""

    id: str
    model: Model
    xyz: Vector
    yaw: float = 0.0
    inside: str | None = None


class Content(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Number of grains in a vessel."""

    inside: str = "jar_1"
    grains: int = 30


class Noise(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Errors of what is measured, drawn from `seed`.

    `position` [m]: of a seen thing, uniform within it on each horizontal axis. Of the wrist sensors on each axis:
    `force` [N], `torque` [Nm]: standard deviation of each sample; `force_bias`, `torque_bias`: largest constant error,
    uniform. Estimates: no data sheet of the sensors was found; torques at a lever of 0.05 m.
    """

    position: float = 0.004
    seed: int = 0
    force: float = 0.1
    force_bias: float = 0.5
    torque: float = 0.005
    torque_bias: float = 0.025


class Scene(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Things, content and noise. Check a scene of your own with `checked`."""

    name: str
    things: tuple[Thing, ...] = msgspec.field(name="thing", default=())
    content: Content | None = None
    noise: Noise = Noise()

    def find(self, name: str) -> Thing | None:
        """Return the thing of this id, or None."""
        return next((thing for thing in self.things if thing.id == name), None)

    def of(self, *models: Model) -> tuple[Thing, ...]:
        """Return all things of these models, in the order of the file."""
        return tuple(thing for thing in self.things if thing.model in models)


class Spread(msgspec.Struct, frozen=True):
    """Largest shifts of things by a seed: cabinet in the world, jar and bowl along the cabinet's depth (x) and width
    (y).

    m and rad. The task succeeded in 20 of 20 runs within it. Estimate of the scatter in a laboratory.
    """

    cabinet: float = 0.04
    cabinet_yaw: float = math.radians(6.0)
    jar_depth: tuple[float, float] = (-0.03, 0.03)
    jar_width: tuple[float, float] = (-0.08, 0.08)
    bowl_depth: tuple[float, float] = (-0.04, 0.02)
    bowl_width: tuple[float, float] = (-0.06, 0.06)


# A wrong unit is found, not every wrong number.
_MOST_NOISE = (
    ("position", "metres", 0.1),
    ("force", "newtons", 10.0),
    ("force_bias", "newtons", 50.0),
    ("torque", "newton metres", 1.0),
    ("torque_bias", "newton metres", 5.0),
)
# A jar 0.2 m high holds no more, and the simulation of a larger pile takes longer than a cycle.
MOST_GRAINS = 60


def load(path: Path = CANONICAL) -> Scene:
    """Return the scene of a TOML file. Raises SceneError naming the field, what it is and what it should be."""
    try:
        scene = msgspec.toml.decode(path.read_bytes(), type=Scene)
    except FileNotFoundError:
        raise SceneError("file", str(path), "the path of a TOML file, as velma/model/scenes/canonical.toml") from None
    except msgspec.ValidationError as error:
        raise SceneError("file", str(path), str(error)) from None
    except msgspec.DecodeError as error:
        raise SceneError("file", str(path), f"TOML ({error})") from None
    return checked(scene)


def checked(scene: Scene) -> Scene:
    """Return the scene itself, if its things can stand together. Raises SceneError."""
    ids = [thing.id for thing in scene.things]
    for thing in scene.things:
        _check_thing(scene, thing, ids.count(thing.id))
    content = scene.content
    if content is not None and content.grains:
        vessel = scene.find(content.inside)
        if vessel is not None and vessel.model is not Model.JAR:
            raise SceneError("content.inside", content.inside, f"the id of a jar, not of a {vessel.model}")
        if not 0 <= content.grains <= MOST_GRAINS:
            raise SceneError("content.grains", content.grains, f"a number from 0 to {MOST_GRAINS}")
    _check_noise(scene.noise)
    return scene


def _check_noise(noise: Noise) -> None:
    for name, unit, most in _MOST_NOISE:
        if not 0 <= getattr(noise, name) <= most:
            raise SceneError(f"noise.{name}", getattr(noise, name), f"{unit}, from 0 to {most:g}")


def _check_thing(scene: Scene, thing: Thing, times: int) -> None:
    if times > 1:
        raise SceneError(f"thing {thing.id}", f"there {times} times", "one thing for each id")
    if not all(math.isfinite(x) and abs(x) <= 10 for x in (*thing.xyz, thing.yaw)):
        raise SceneError(f"thing {thing.id}", (thing.xyz, thing.yaw), "metres and radians within +-10")
    if thing.inside is not None:
        around = scene.find(thing.inside)
        cabinets = [cabinet.id for cabinet in scene.of(Model.CABINET)]
        if around is None or around.model is not Model.CABINET:
            raise SceneError(f"thing {thing.id}: inside", thing.inside, f"the id of a cabinet, one of {cabinets}")


def vary(scene: Scene, seed: int, spread: Spread | None = None) -> Scene:
    """Return the scene varied by a seed: cabinets moved with their contents, jars and bowls moved inside them and
    turned, noise with the same seed. Each thing has its own random stream, so that leaving one out does not move the
    others. A thing that is inside nothing stays where the file puts it."""
    spread = spread or Spread()
    moved = {thing.id: _moved_cabinet(thing, seed, spread) for thing in scene.of(Model.CABINET)}
    things = [moved.get(thing.id) or _moved_inside(scene, thing, moved, seed, spread) for thing in scene.things]
    return msgspec.structs.replace(
        scene,
        name=f"{scene.name}, seed {seed}",
        things=tuple(things),
        noise=msgspec.structs.replace(scene.noise, seed=seed),
    )


def _stream(seed: int, thing: Thing) -> np.random.Generator:
    return np.random.default_rng([seed, *thing.id.encode()])


def _moved_cabinet(thing: Thing, seed: int, spread: Spread) -> Thing:
    rng = _stream(seed, thing)
    dx, dy = rng.uniform(-spread.cabinet, spread.cabinet, 2)
    x, y, z = thing.xyz
    yaw = thing.yaw + rng.uniform(-spread.cabinet_yaw, spread.cabinet_yaw)
    return msgspec.structs.replace(thing, xyz=(x + float(dx), y + float(dy), z), yaw=float(yaw))


def _moved_inside(scene: Scene, thing: Thing, moved: dict[str, Thing], seed: int, spread: Spread) -> Thing:
    before = scene.find(thing.inside) if thing.inside is not None else None
    if before is None or thing.model not in (Model.JAR, Model.BOWL):
        return thing
    rng, after = _stream(seed, thing), moved[before.id]
    jar = thing.model is Model.JAR
    depth = rng.uniform(*(spread.jar_depth if jar else spread.bowl_depth))
    width = rng.uniform(*(spread.jar_width if jar else spread.bowl_width))
    local = _rotation(-before.yaw) @ (np.array(thing.xyz[:2]) - before.xyz[:2]) + (depth, width)
    x, y = _rotation(after.yaw) @ local + after.xyz[:2]
    z = thing.xyz[2] + after.xyz[2] - before.xyz[2]
    yaw = float(rng.uniform(-math.pi, math.pi))
    return msgspec.structs.replace(thing, xyz=(float(x), float(y), z), yaw=yaw)


def _rotation(yaw: float) -> np.ndarray:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])
