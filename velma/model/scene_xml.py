"""Writes a scene as MJCF around the robot: furniture, vessels, and the settings of the physics.

Contact shapes (groups 0 and 3) and visual shapes (group 1) are separate: a vessel is plates and
rings for physics and a smooth surface for pictures. Names: a body per thing under its id, and
`grain_<k>` for each ball of the content.
"""

import math
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree as ET

import numpy as np

from velma.model import surfaces
from velma.model.build import (
    SHAPE_GROUP,
    Kind,
    add_class,
    masks,
    quat_wxyz,
    text,
)
from velma.model.kinds import BOXES, CABINETS, DOORS, TABLES, Model, Numbers, objects
from velma.model.scene import Content, Scene, SceneObject, Vector
from velma.model.tree import LOOK_CLASS, ROBOT_XML
from velma.names import FT_BODY

WRIST_SENSORS = ("force", "torque")


def scene_xml(scene: Scene) -> str:
    """Return the MJCF of the robot in a scene, ready for `mujoco.MjModel.from_xml_string`."""
    root = ET.parse(ROBOT_XML).getroot()
    root.set("model", scene.name)
    option = {
        key: value if isinstance(value, str) else f"{value:g}"
        for key, value in objects()["option"].items()
    }
    # An unstable simulation must not be reset: the robot would be back at the start as if nothing
    # had happened.
    ET.SubElement(ET.SubElement(root, "option", option), "flag", autoreset="disable")
    # 60 grains that spin need 2 MB in a pour (measured); the loop locks all
    ET.SubElement(root, "size", memory="16M")
    default, world = root.find("default"), root.find("worldbody")
    assert default is not None
    assert world is not None
    _classes(default, _contacts(scene.content))
    surfaces.studio(root, world)
    _wrists(root)
    for thing in scene.things:
        _DRAW[thing.model](world, thing)
    vessel = scene.find(scene.content.inside) if scene.content else None
    if vessel is not None and scene.content is not None:
        _add_grains(world, vessel.xyz, scene.content)
    return ET.tostring(root, encoding="unicode")


def _wrists(root: ET.Element) -> None:
    """Add the wrist sensors. Their sites cannot stand in robot.xml: Pinocchio would misplace
    them.
    """
    bodies = {body.get("name"): body for body in root.iter("body")}
    sensors = ET.SubElement(root, "sensor")
    for side, name in FT_BODY.items():
        ET.SubElement(bodies[name], "site", name=name, rgba="0 0 0 0")
        for kind in WRIST_SENSORS:
            ET.SubElement(sensors, kind, name=f"{side}_{kind}", site=name)


def _classes(default: ET.Element, contact: Numbers) -> None:
    def words(kind: str) -> dict[str, str]:
        numbers = contact[kind]
        return {
            key: text(value) if isinstance(value, list) else f"{value:g}"
            for key, value in numbers.items()
        }

    robot, thing = Kind.ARM | Kind.HAND, Kind.WORLD | Kind.HAND | Kind.OBJECT | Kind.ARM
    hidden = {"group": SHAPE_GROUP, "mass": "0"}
    for name, kind, meets, of, more in (
        ("furniture", Kind.WORLD, robot | Kind.OBJECT | Kind.GRAIN, "furniture", {}),
        ("jar", Kind.OBJECT, thing, "object", hidden),
        ("box", Kind.OBJECT, thing, "object", {"material": "carton", "mass": "0"}),
        ("lid", Kind.OBJECT, thing, "object", {"material": "steel", "mass": "0"}),
        ("inner", Kind.INNER, Kind.GRAIN, "inner", hidden),
        ("bowl", Kind.OBJECT | Kind.INNER, thing | Kind.GRAIN, "object", hidden),
        ("grain", Kind.GRAIN, Kind.GRAIN | Kind.INNER | Kind.WORLD, "grain", {}),
    ):
        add_class(default, name, **more, **masks(kind, meets), **words(of))


def _body(world: ET.Element, thing: SceneObject, *, free: bool) -> ET.Element:
    place = {"pos": text(thing.xyz), "quat": text(quat_wxyz((thing.roll, thing.pitch, thing.yaw)))}
    body = ET.SubElement(world, "body", {"name": thing.id, **place})
    if free:
        ET.SubElement(body, "freejoint", name=thing.id)
    return body


def _geom(body: ET.Element, name: str, kind: str, size: Sequence[float], **attributes: str) -> None:
    ET.SubElement(
        body,
        "geom",
        {"name": f"{body.get('name')}_{name}", "type": kind, "size": text(size), **attributes},
    )


def _furniture(world: ET.Element, thing: SceneObject) -> None:
    _parts(_body(world, thing, free=False), thing.model)


def _parts(body: ET.Element, model: Model) -> None:
    for name, part in objects()[model]["parts"].items():
        look = {"class": "furniture", "material": surfaces.material(model, name)}
        _geom(body, name, "box", [edge / 2 for edge in part["box"]], pos=text(part["xyz"]), **look)


def _jar(world: ET.Element, thing: SceneObject) -> None:
    """Add an outer cylinder for hands and furniture, and inside a ring of plates and a bottom for
    grains.
    """
    jar, body = objects()["jar"], _body(world, thing, free=True)
    ET.SubElement(
        body, "inertial", pos="0 0 0", mass=text([jar["mass"]]), diaginertia=text(jar["inertia"])
    )
    radius, half, wall = jar["radius"], jar["height"] / 2, jar["wall"]
    _geom(body, "side", "cylinder", (radius, half), **{"class": "jar"})
    ring, inner = jar["inner_ring"], radius - wall
    # A thick bottom below that of the jar: thicker than the radius of a grain, so that none is
    # pressed through.
    _geom(
        body,
        "bottom",
        "cylinder",
        (radius + 0.005, 0.01),
        pos=text((0, 0, -half - 0.005)),
        **{"class": "inner"},
    )
    thick, plates = ring["thickness"], ring["plates"]
    width, middle = (inner + thick) * math.tan(math.pi / plates), inner + thick / 2
    for k in range(plates):
        around = 2 * math.pi * k / plates
        place = {
            "pos": text((middle * math.cos(around), middle * math.sin(around), 0.004)),
            "quat": text(quat_wxyz((0, 0, around))),
        }
        _geom(
            body,
            f"inner_{k}",
            "box",
            (thick / 2, width, half - 0.004),
            **place,
            **{"class": "inner"},
        )
    _look(body, "jar")


def _bowl(world: ET.Element, thing: SceneObject) -> None:
    """Add a disc and slanted plates that everything touches: flared, so that fingers and grains
    meet the real wall.
    """
    bowl, body = objects()["bowl"], _body(world, thing, free=True)
    mass, rim, base, height = bowl["mass"], bowl["rim_radius"], bowl["base_radius"], bowl["height"]
    # of a flared shell with a base, estimate
    about = text((0.006 * mass, 0.006 * mass, 0.008 * mass))
    ET.SubElement(
        body, "inertial", pos=text((0, 0, 0.4 * height)), mass=text([mass]), diaginertia=about
    )
    foot = bowl["base"] / 2
    _geom(body, "base", "cylinder", (base, foot), pos=text((0, 0, foot)), **{"class": "bowl"})
    slant, length = math.atan2(rim - base, height - foot), math.hypot(rim - base, height - foot)
    width, middle = rim * math.tan(math.pi / bowl["plates"]), (rim + base - bowl["wall"]) / 2
    for k in range(bowl["plates"]):
        around = 2 * math.pi * k / bowl["plates"]
        at = (middle * math.cos(around), middle * math.sin(around), (height + foot) / 2)
        place = {"pos": text(at), "quat": text(quat_wxyz((0, slant, around)))}
        _geom(
            body,
            f"plate_{k}",
            "box",
            (bowl["wall"] / 2, width, length / 2),
            **place,
            **{"class": "bowl"},
        )
    _look(body, "bowl")


def _door(world: ET.Element, thing: SceneObject) -> None:
    """Add a leaf on its hinge. The panel has all of its mass, spread evenly."""
    leaf, body = objects()[thing.model], _body(world, thing, free=False)
    hinge, opens, panel = leaf["hinge"], leaf["opens"], leaf["parts"]["panel"]
    turn = {"type": "hinge", "axis": "0 0 1", "limited": "true", "ref": text([opens * thing.open])}
    turn["range"] = text(sorted(opens * angle for angle in hinge["range"]))
    turn |= {key: text([hinge[key]]) for key in ("damping", "frictionloss")}
    ET.SubElement(body, "joint", {"name": thing.id, **turn})
    x, y, z = panel["box"]
    about = text([leaf["mass"] / 12 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y))])
    ET.SubElement(
        body, "inertial", pos=text(panel["xyz"]), mass=text([leaf["mass"]]), diaginertia=about
    )
    _parts(body, thing.model)


def _box(world: ET.Element, thing: SceneObject) -> None:
    """Add a closed box; its inertia is that of its mass spread evenly."""
    box, body = objects()[thing.model], _body(world, thing, free=True)
    x, y, z = box["edges"]
    about = [box["mass"] / 12 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y))]
    ET.SubElement(body, "inertial", pos="0 0 0", mass=text([box["mass"]]), diaginertia=text(about))
    _geom(body, "side", "box", (x / 2, y / 2, z / 2), **{"class": "box"})


def _lid(world: ET.Element, thing: SceneObject) -> None:
    """Add a flat cylinder; its inertia is that of its mass spread evenly."""
    lid, body = objects()[thing.model], _body(world, thing, free=True)
    radius, height, mass = lid["radius"], lid["height"], lid["mass"]
    across = mass / 12 * (3 * radius**2 + height**2)
    about = text((across, across, mass / 2 * radius**2))
    ET.SubElement(body, "inertial", pos="0 0 0", mass=text([mass]), diaginertia=about)
    _geom(body, "side", "cylinder", (radius, height / 2), **{"class": "lid"})


def _look(body: ET.Element, mesh: str) -> None:
    part = surfaces.VESSELS[mesh]
    look = {"class": LOOK_CLASS, "mesh": part.mesh, "material": part.material}
    name = f"{body.get('name')}_{part.mesh}"
    ET.SubElement(body, "geom", {"name": name, "type": "mesh", **look})


_DRAW = {
    Model.JAR: _jar,
    Model.BOWL: _bowl,
    Model.LID: _lid,
    **dict.fromkeys((*CABINETS, *TABLES), _furniture),
    **dict.fromkeys(BOXES, _box),
    **dict.fromkeys(DOORS, _door),
}


# --- The content of a jar: balls ------------------------------------------------------------------
# Grains that do not spin slide along three axes, and their coordinates count from where they begin.
# Those that spin have a free joint, and theirs are in the world: the first three of both are along
# the axes of the world.

AXES = ("1 0 0", "0 1 0", "0 0 1")
GRAIN = "grain_"
"""The body of the k-th grain is GRAIN and k."""


def grain_name(k: int) -> str:
    """Return the body of the k-th grain."""
    return f"{GRAIN}{k}"


def _contacts(content: Content | None) -> Numbers:
    """Return the numbers of all contacts, those of grains and of the inside of a jar as the content
    says.
    """
    contact: dict[str, Numbers] = dict(objects()["contact"])
    if content is not None and content.friction is not None:
        inner = contact["inner"]
        contact["inner"] = {**inner, "friction": [content.friction, *inner["friction"][1:]]}
    if content is not None and content.spin:
        spin = objects()["spin"]
        for kind in ("grain", "inner"):
            friction = [contact[kind]["friction"][0], spin["about_normal"], spin["rolling"]]
            contact[kind] = {**contact[kind], "friction": friction, "condim": spin["condim"]}
    return contact


def _add_grains(world: ET.Element, jar: Vector, content: Content) -> None:
    """Add the grains, in a jar whose centre is at `jar` [m]."""
    grain = objects()["grain"]
    for k, at in zip(
        range(content.grains), _stacked(objects()["jar"], grain["radius"]), strict=False
    ):
        body = ET.SubElement(world, "body", name=grain_name(k), pos=text(np.add(jar, at)))
        if content.spin:
            ET.SubElement(body, "freejoint")
        else:
            for axis in AXES:
                ET.SubElement(body, "joint", type="slide", axis=axis)
        look = {"class": "grain", "material": "grain"}
        size = text([grain["radius"]])
        ET.SubElement(
            body, "geom", {"type": "sphere", "size": size, "mass": text([grain["mass"]]), **look}
        )


def _stacked(jar: Numbers, radius: float) -> Iterator[Vector]:
    """Yield places in a jar without overlap, layer by layer from the bottom, in the frame of the
    jar.
    """
    room = jar["radius"] - jar["wall"] - radius - 0.0015
    pitch = 2.06 * radius
    reach = int(room / pitch) + 2
    for layer in range(int(jar["height"] / pitch)):
        z = -jar["height"] / 2 + 0.006 + radius + 0.95 * pitch * layer
        shift = 0.25 * pitch * (layer % 2)
        for ix in range(-reach, reach + 1):
            for iy in range(-reach, reach + 1):
                x, y = (ix + 0.5 * (iy % 2)) * pitch + shift, 0.87 * iy * pitch + shift
                if math.hypot(x, y) <= room:
                    yield x, y, z
