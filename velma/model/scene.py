"""A scene: things and their poses, contents, noise of observations. Read from TOML, varied by a
seed.

Ids are those that the agents use (jar_1, bowl_1, cabinet_2, table_1, ...). A scene may lack any of
them. Knows no physics: scene_xml.py writes a scene as MJCF.
"""

import math
import re
from pathlib import Path

import msgspec
import numpy as np

from velma.errors import SceneError
from velma.model import markers
from velma.model.kinds import CABINETS, DOORS, TABLES, Model, objects

Vector = tuple[float, float, float]

# --- Leaves of cabinets: where they hang, and how far they open. Angles in rad, 0 closed; a cabinet
# stands upright


def hanging(model: str, cabinet: Vector, yaw: float, angle: float) -> tuple[Vector, float]:
    """Return place [m] and yaw of a leaf that is open by `angle`, at a cabinet at this place with
    this yaw.
    """
    x, y, z = objects()[model]["hinge"]["xyz"]
    c, s = math.cos(yaw), math.sin(yaw)
    at = cabinet[0] + c * x - s * y, cabinet[1] + s * x + c * y, cabinet[2] + z
    return at, yaw + objects()[model]["opens"] * angle


def limits(model: str) -> tuple[float, float]:
    """Return the least and the most that a leaf opens."""
    least, most = objects()[model]["hinge"]["range"]
    return least, most


# --- The line of a scene's TOML file that an error is about. Knows the file's layout, not what a
# scene means


_PATH = re.compile(r"\$\.(?P<table>\w+)(?:\[(?P<number>\d+)\])?(?:\.(?P<key>\w+))?")
_THING = re.compile(r"thing (?P<id>\S+?)(?:: (?P<key>\w+))?$")
_FIELD = re.compile(r"(?P<table>\w+)\.(?P<key>\w+)$")


Lines = list[tuple[int, str]]  # of the file, with their numbers


def of_path(text: str, message: str) -> int:
    """Return the line of the path in a message of msgspec, as in "- at `$.thing[2].xyz`"; 1 if
    there is none.
    """
    found = _PATH.search(message)
    if not found:
        return 1
    number, blocks = int(found["number"] or 0), _blocks(text, found["table"])
    if number < len(blocks):
        return _line(blocks[number], found["key"] or "")
    return _line(list(enumerate(text.splitlines(), 1)), found["table"])


def of_field(text: str, field: str) -> int:
    """Return the line of a field as SceneError names it: "thing jar_1: inside", "noise.force"; 1 if
    there is none.
    """
    named, key = list[Lines](), ""
    if found := _THING.match(field):
        same = re.compile(rf"\s*id\s*=\s*[\"']{re.escape(found['id'])}[\"']")
        every = _blocks(text, "thing")
        named = [block for block in every if any(same.match(line) for _, line in block)]
        key = found["key"] or "id"
    elif found := _FIELD.match(field):
        named, key = _blocks(text, found["table"])[:1], found["key"]
    return _line(named[-1], key) if named else 1


def _blocks(text: str, table: str) -> list[Lines]:
    """Return the lines of each table of this name, its head first."""
    blocks = [("", Lines())]
    for number, line in enumerate(text.splitlines(), 1):
        if head := re.match(r"\s*\[+\s*(\w+)\s*\]+", line):
            blocks.append((head[1], []))
        blocks[-1][1].append((number, line))
    return [lines for name, lines in blocks if name == table]


def _line(lines: Lines, key: str) -> int:
    """Return the number of the line of a key, of the first one where the key is not there."""
    begins = re.compile(rf"\s*{key}\s*=")
    return next((number for number, line in lines if begins.match(line)), lines[0][0])


# --- A scene --------------------------------------------------------------------------------------


CANONICAL = Path(__file__).parent / "scenes" / "canonical.toml"

NOWHERE: Vector = (math.nan, math.nan, math.nan)
"""Of a thing whose place the file does not say."""


class SceneObject(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A thing in the world: position [m] of its model's origin, turned by Rz(yaw) Ry(pitch)
    Rx(roll) [rad].

    `inside`: the cabinet that it stands in and moves with; `on`: the table that it stands on. A
    seed moves jars and bowls in or on these. `of`: the cabinet at which a leaf hangs, `open` by
    this angle [rad]; both give its pose.
    """

    id: str
    model: Model
    xyz: Vector = NOWHERE
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    inside: str | None = None
    on: str | None = None
    of: str | None = None
    open: float = 0.0


class Content(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Number of grains in a vessel; their friction on its inside, None: that of objects.yaml;
    whether they turn.
    """

    inside: str = "jar_1"
    grains: int = 30
    friction: float | None = None
    spin: bool = False


class Noise(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Errors of what is measured, drawn from `seed`.

    Of eyes by rays: `position`, `height` [m]: of a seen thing on each horizontal axis and upwards,
    uniform; `bias` [m]: constant for a thing, on each axis; `outliers`: share of sights that are
    off by up to 0.1 m.

    Of the robot: `joint` [rad], standard deviation of measured positions of body joints, from which
    their speeds are computed; `delay`: cycles by which both are late, 0 or 1; `weight`: largest
    share by which a drive errs about the weight that it holds. `mass`: largest share by which
    things are heavier or lighter than their models say.

    Of the wrist sensors on each axis: `force` [N], `torque` [Nm]: standard deviation of each
    sample; `force_bias`, `torque_bias`: largest constant error, uniform. Estimates: no data sheet
    of the sensors was found; torques at a lever of 0.05 m.

    Of the head camera, for eyes by pixels: `pixel` [grey levels] and `blur` [pixels], standard
    deviations of noise and point spread; `exposure`: largest share by which a picture is too bright
    or dark; `camera_turn` [rad], `camera_shift` [m]: largest error on each axis of where the robot
    thinks that its camera is, uniform, constant. Estimates: a camera indoors, at rest, calibrated.
    """

    position: float = 0.004
    seed: int = 0
    force: float = 0.1
    force_bias: float = 0.5
    torque: float = 0.005
    torque_bias: float = 0.025
    pixel: float = 5.0
    blur: float = 0.0
    exposure: float = 0.0
    camera_turn: float = 0.0
    camera_shift: float = 0.0
    height: float = 0.0
    bias: float = 0.0
    outliers: float = 0.0
    joint: float = 0.0
    delay: int = 0
    weight: float = 0.0
    mass: float = 0.0


class Spread(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Largest shifts of things by a seed: cabinet in the world, jar and bowl along the cabinet's
    depth (x) and width (y), jar and bowl on a table along its x and y.

    m and rad. In the canonical scene the task succeeded in 20 of 20 runs within the default.
    Estimate of the scatter in a laboratory.
    """

    cabinet: float = 0.04
    cabinet_yaw: float = math.radians(6.0)
    jar_depth: tuple[float, float] = (-0.03, 0.03)
    jar_width: tuple[float, float] = (-0.08, 0.08)
    bowl_depth: tuple[float, float] = (-0.04, 0.02)
    bowl_width: tuple[float, float] = (-0.06, 0.06)
    table_x: tuple[float, float] = (-0.03, 0.03)
    table_y: tuple[float, float] = (-0.03, 0.03)


class Scene(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Things, content, noise, and how far a seed moves things. Check a scene of your own with
    `checked`.
    """

    name: str
    things: tuple[SceneObject, ...] = msgspec.field(name="thing", default=())
    content: Content | None = None
    noise: Noise = Noise()
    spread: Spread = Spread()

    def find(self, name: str) -> SceneObject | None:
        """Return the thing of this id, or None."""
        return next((thing for thing in self.things if thing.id == name), None)

    def of(self, *models: Model) -> tuple[SceneObject, ...]:
        """Return all things of these models, in the order of the file."""
        return tuple(thing for thing in self.things if thing.model in models)


# A wrong unit is found, not every wrong number.
MOST_NOISE = (
    ("position", "metres", 0.1),
    ("force", "newtons", 10.0),
    ("force_bias", "newtons", 50.0),
    ("torque", "newton metres", 1.0),
    ("torque_bias", "newton metres", 5.0),
    ("pixel", "grey levels", 50.0),
    ("blur", "pixels", 5.0),
    ("exposure", "a share", 0.9),
    ("camera_turn", "radians", 0.1),
    ("camera_shift", "metres", 0.1),
    ("height", "metres", 0.1),
    ("bias", "metres", 0.1),
    ("outliers", "a share", 1.0),
    ("joint", "radians", 0.01),
    ("delay", "a cycle", 1),
    ("weight", "a share", 0.5),
    ("mass", "a share", 0.9),
)
# no body of the robot or of the content is named like that
_ID = re.compile(r"(?!grain_\d)[a-z]+(_[a-z]+)*_\d+")
MOST_SPREAD = 0.5  # [m, rad] estimate: a wrong unit is found
# A jar 0.2 m high holds no more, and the simulation of a larger pile takes longer than a cycle.
MOST_GRAINS = 60
MOST_FRICTION = 3.0  # estimate: grains that stick to a wall of 70 degrees


def load(path: Path = CANONICAL) -> Scene:
    """Return the scene of a TOML file. Raises SceneError naming file, line, field, what it is and
    what it should be.
    """
    try:
        text = path.read_text("utf-8-sig")
        return checked(hung(msgspec.toml.decode(text, type=Scene)))
    except FileNotFoundError:
        raise SceneError(
            "file", str(path), "the path of a TOML file, as velma/model/scenes/canonical.toml"
        ) from None
    except UnicodeDecodeError as error:
        raise SceneError("file", str(path), f"text in UTF-8 ({error})") from None
    except msgspec.ValidationError as error:
        raise SceneError("file", f"{path}:{of_path(text, str(error))}", str(error)) from None
    except msgspec.DecodeError as error:
        raise SceneError("file", str(path), f"TOML ({error})") from None
    except SceneError as error:
        line = of_field(text, error.field)
        raise SceneError(f"{error.field} ({path}:{line})", error.found, error.expected) from None


def checked(scene: Scene) -> Scene:
    """Return the scene itself, if its things can stand together and be seen. Raises SceneError."""
    ids = [thing.id for thing in scene.things]
    for thing in scene.things:
        _check_thing(scene, thing, ids.count(thing.id))
    content = scene.content
    if content is not None and content.grains:
        jars = [jar.id for jar in scene.of(Model.JAR) if not (jar.pitch or jar.roll)]
        if content.inside not in jars:
            raise SceneError(
                "content.inside",
                content.inside,
                f"the id of a jar that stands upright, one of {jars}",
            )
        if not 0 <= content.grains <= MOST_GRAINS:
            raise SceneError("content.grains", content.grains, f"a number from 0 to {MOST_GRAINS}")
        if content.friction is not None and not 0 <= content.friction <= MOST_FRICTION:
            raise SceneError(
                "content.friction", content.friction, f"a number from 0 to {MOST_FRICTION:g}"
            )
    _check_noise(scene.noise)
    _check_spread(scene.spread)
    markers.of_scene(scene)  # a thing without any would never be found
    return scene


def _check_noise(noise: Noise) -> None:
    for name, unit, most in MOST_NOISE:
        if not 0 <= getattr(noise, name) <= most:
            raise SceneError(f"noise.{name}", getattr(noise, name), f"{unit}, from 0 to {most:g}")


def _check_spread(spread: Spread) -> None:
    for name, value in msgspec.structs.asdict(spread).items():
        low, high = value if isinstance(value, tuple) else (0.0, value)
        if not -MOST_SPREAD <= low <= high <= MOST_SPREAD:
            raise SceneError(
                f"spread.{name}", value, f"the smaller number first, both within +-{MOST_SPREAD:g}"
            )


def _check_thing(scene: Scene, thing: SceneObject, times: int) -> None:
    if not _ID.fullmatch(thing.id):
        raise SceneError(
            f"thing {thing.id}",
            thing.id,
            "a kind in small letters and a number, as jar_1; not grain_1",
        )
    if times > 1:
        raise SceneError(f"thing {thing.id}", f"there {times} times", "one thing for each id")
    for field, name, kind, models in (
        ("inside", thing.inside, "a cabinet", CABINETS),
        ("on", thing.on, "a table", TABLES),
        ("of", thing.of, "a cabinet with doors", (Model.CABINET_DOOR,)),
    ):
        possible = [one.id for one in scene.of(*models)]
        if name is not None and name not in possible:
            raise SceneError(
                f"thing {thing.id}: {field}", name, f"the id of {kind}, one of {possible}"
            )
    _check_leaf(scene, thing)
    pose = (*thing.xyz, thing.yaw, thing.pitch, thing.roll)
    if not all(math.isfinite(x) and abs(x) <= 10 for x in pose):
        raise SceneError(f"thing {thing.id}", pose, "metres and radians within +-10")


def _check_leaf(scene: Scene, thing: SceneObject) -> None:
    """Raise SceneError for a leaf that hangs at nothing or is open too far, and for another thing
    that does.
    """
    if thing.model not in DOORS:
        if thing.of is not None or thing.open:
            field = "open" if thing.of is None else "of"
            raise SceneError(
                f"thing {thing.id}: {field}", thing.model, "only a leaf that hangs and opens"
            )
        return
    if thing.of is None:
        cabinets = [one.id for one in scene.of(Model.CABINET_DOOR)]
        raise SceneError(
            f"thing {thing.id}", "a leaf that hangs nowhere", f"`of`, one of {cabinets}"
        )
    least, most = limits(thing.model)
    if not least <= thing.open <= most:
        raise SceneError(f"thing {thing.id}: open", thing.open, f"radians from {least} to {most}")
    around = scene.find(thing.of)
    if around is not None and around.model is Model.CABINET_DOOR and _hung(thing, around) != thing:
        raise SceneError(
            f"thing {thing.id}",
            (*thing.xyz, thing.yaw),
            "no xyz and yaw: they follow from `of` and `open`",
        )


def hung(scene: Scene) -> Scene:
    """Return the scene with each leaf where it hangs at its cabinet, if the file does not say where
    it is.
    """
    things = tuple(_where_it_hangs(scene, thing) for thing in scene.things)
    return msgspec.structs.replace(scene, things=things)


def _where_it_hangs(scene: Scene, thing: SceneObject) -> SceneObject:
    around = scene.find(thing.of) if thing.of is not None and math.isnan(thing.xyz[0]) else None
    return thing if around is None or thing.model not in DOORS else _hung(thing, around)


def _hung(leaf: SceneObject, cabinet: SceneObject) -> SceneObject:
    """Return the leaf at its hinge, turned by its angle."""
    xyz, yaw = hanging(leaf.model, cabinet.xyz, cabinet.yaw, leaf.open)
    return msgspec.structs.replace(leaf, xyz=xyz, yaw=yaw)


def vary(scene: Scene, seed: int) -> Scene:
    """Return the scene varied by a seed: cabinets moved with their contents, jars and bowls moved
    in them and on tables and turned, noise with the same seed. Each thing has its own random
    stream, so that leaving one out does not move the others. A thing that is in or on nothing stays
    where the file puts it. Seed 0 varies nothing.
    """
    if seed == 0:
        return scene
    spread = scene.spread
    moved = {thing.id: _moved_cabinet(thing, seed, spread) for thing in scene.of(*CABINETS)}
    things = [
        moved.get(thing.id) or _moved(scene, thing, moved, seed, spread) for thing in scene.things
    ]
    return msgspec.structs.replace(
        scene,
        name=f"{scene.name}, seed {seed}",
        things=tuple(things),
        noise=msgspec.structs.replace(scene.noise, seed=seed),
    )


def _stream(seed: int, thing: SceneObject) -> np.random.Generator:
    return np.random.default_rng([seed, *thing.id.encode()])


def _moved_cabinet(thing: SceneObject, seed: int, spread: Spread) -> SceneObject:
    rng = _stream(seed, thing)
    dx, dy = rng.uniform(-spread.cabinet, spread.cabinet, 2)
    x, y, z = thing.xyz
    yaw = thing.yaw + rng.uniform(-spread.cabinet_yaw, spread.cabinet_yaw)
    return msgspec.structs.replace(thing, xyz=(x + float(dx), y + float(dy), z), yaw=float(yaw))


def _moved(
    scene: Scene, thing: SceneObject, moved: dict[str, SceneObject], seed: int, spread: Spread
) -> SceneObject:
    """Return a thing moved with its cabinet; a jar or a bowl also in its cabinet or on its table,
    and turned.
    """
    if thing.of in moved:
        return _hung(thing, moved[thing.of])
    before = next((one for one in scene.things if one.id in (thing.inside, thing.on)), None)
    if before is None:
        return thing
    after, varied = moved.get(before.id, before), thing.model in (Model.JAR, Model.BOWL)
    shift, yaw = (
        _shift(thing, seed, spread) if varied else (np.zeros(2), thing.yaw + after.yaw - before.yaw)
    )
    local = _rotation(-before.yaw) @ (np.array(thing.xyz[:2]) - before.xyz[:2]) + shift
    x, y = _rotation(after.yaw) @ local + after.xyz[:2]
    z = thing.xyz[2] + after.xyz[2] - before.xyz[2]
    return msgspec.structs.replace(thing, xyz=(float(x), float(y), z), yaw=yaw)


def _shift(thing: SceneObject, seed: int, spread: Spread) -> tuple[np.ndarray, float]:
    """Return a shift (2,) along the axes of what it stands in or on [m], and a yaw [rad]."""
    rng = _stream(seed, thing)
    if thing.on is not None:
        ranges = spread.table_x, spread.table_y
    elif thing.model is Model.JAR:
        ranges = spread.jar_depth, spread.jar_width
    else:
        ranges = spread.bowl_depth, spread.bowl_width
    return np.array([rng.uniform(*bounds) for bounds in ranges]), float(
        rng.uniform(-math.pi, math.pi)
    )


def _rotation(yaw: float) -> np.ndarray:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])
