"""`roco fault sensor`, `roco fault thing`: senses of the simulated robot that fail, things that
somebody moves.

The order stands in a file of the run folder that the simulator alone reads; the robot's agents are
told nothing.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from msgspec.structs import replace

from companion.eyes import VARIABLE as EYES
from companion.eyes import Eyes
from companion.languages import values
from companion.run_files import DISTURBANCES_FILE
from companion.tools.system import LOOP
from companion.tools.verbs.checkup import BACKEND
from console import interrupts
from console.completion import among
from console.errors import ConsoleError, FleetError, UsageError
from console.faults import inflict, moments
from console.faults.kinds import Kind
from console.faults.verbs import WITHIN_S, At, Within, heal_left, lasted
from console.fleet import targets
from console.fleet.targets import Target
from console.output import Form, Format, RunDir, problems, tell_json
from operate.fault_lines import Fault
from operate.fault_proxy.files import WIRES_FILE
from velma.errors import VelmaError
from velma.model import scene
from velma.model.kinds import MOVEABLE
from velma.sim import disturbances
from velma.sim.disturbances import ROWS, SENSES, Disturbance, Of

EYE = "ex"
"""The process whose child takes the camera's pictures."""
SCENE = "ROCO_SCENE"
FOR_S = 10.0
"""Estimate: an act of the robot takes 3 to 10 s."""


MOVES = tuple(kind for kind in ROWS[Of.THING] if kind is not disturbances.Kind.MOVED)
"""What somebody does with a thing that can be taken; the last kind befalls furniture."""
FAILS = tuple(dict.fromkeys(kind for sense in SENSES for kind in ROWS[sense]))
E = TypeVar("E", bound=StrEnum)


def one_of(known: Sequence[E]) -> dict[str, Any]:
    """The settings of an argument or option that takes one of these."""

    def name(word: str) -> E:
        try:
            return next(one for one in known if one == word)
        except StopIteration:
            raise typer.BadParameter(f"{word!r} is not one of {', '.join(known)}") from None

    def complete(incomplete: str) -> list[str]:
        return among(known, incomplete)

    return {"parser": name, "metavar": f"[{'|'.join(known)}]", "autocompletion": complete}


def joints(incomplete: str) -> list[str]:
    """The joints that have an encoder."""
    return among(disturbances.ON[Of.ENCODER], incomplete)


def moveable(ctx: typer.Context, incomplete: str) -> list[str]:
    """The things of a fleet's scene that can be taken; none where no fleet is there."""
    fleet = targets.meant(ctx)
    with suppress(ConsoleError):
        return [] if fleet is None else among(takeable_objects(fleet), incomplete)
    return []


For = Annotated[float, typer.Option("--for", min=0.1, help="Seconds until it is healed.")]


def sensor(
    sense: Annotated[Of, typer.Argument(help="What fails.", **one_of(SENSES))],
    kind: Annotated[
        disturbances.Kind,
        typer.Option(help="How it fails; each sense has some of them.", **one_of(FAILS)),
    ],
    side: Annotated[values.Side | None, typer.Option(help="Of wrist and grip; else both.")] = None,
    joint: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Of encoder, such as left_arm_3_joint.", autocompletion=joints
        ),
    ] = "",
    by: Annotated[
        float | None,
        typer.Option(
            metavar="SIZE",
            help="Of a bias, in N or rad; of dimmed, the share of light that is left.",
        ),
    ] = None,
    at: At = "",
    for_: For = FOR_S,
    within: Within = WITHIN_S,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Let a sense of the simulated robot fail.

    wrist: zero, stuck, nan, bias. camera: black, frozen, dimmed, mirrored. encoder: bias, stuck.
    grip (what the fingers feel): stuck, zero. The fleet is up with --faults; nothing tells the
    robot.

    Examples:
      roco fault sensor wrist --kind zero --side left
      roco fault sensor encoder --kind bias --joint left_arm_3_joint --by 0.05
      roco fault sensor camera --kind frozen --for 20
    """
    with problems(form), interrupts.heard():
        one = Disturbance("", sense, kind, joint or side or "", () if by is None else (by,))
        if joint and side:
            raise UsageError(
                "--side and --joint name two parts; an encoder has a joint, wrist and grip have a"
                " side"
            )
        if sense is Of.ENCODER and not joint:
            joints = ", ".join(disturbances.ON[Of.ENCODER])
            raise UsageError(f"which encoder? name its joint: --joint, one of {joints}")
        ordered(one, at, for_, within, target, run_dir, form)


def thing(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A thing of the scene that can be taken: jar_1.",
            autocompletion=moveable,
        ),
    ],
    kind: Annotated[
        disturbances.Kind, typer.Option(help="What somebody does with it.", **one_of(MOVES))
    ],
    by: Annotated[
        str,
        typer.Option(
            metavar="X,Y,Z",
            help=(
                "In the robot's frame: how far it is pushed (m), in which direction it is tipped,"
                " at which place it is"
                " added (m), with which force it is pulled or knocked (N); else 5 cm to its left,"
                " to its left, where the"
                " scene has it, 10 or 20 N forwards."
            ),
        ),
    ] = "",
    at: At = "",
    for_: For = FOR_S,
    within: Within = WITHIN_S,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Push, tip, remove, add, pull or knock a thing of the simulated world.

    What is removed stands on the floor behind the robot, and is put back after --for; added is a
    thing that stands elsewhere. What was pushed, tipped or added stays so. A person pulls as long
    as --for, and carries off what the robot lets go. The fleet is up with --faults; nothing tells
    the robot.

    Examples:
      roco fault thing bowl_1 --kind pushed --by 0,-0.05,0
      roco fault thing jar_1 --kind tipped --at pl:searching
      roco fault thing jar_1 --kind removed --for 60
    """
    with problems(form), interrupts.heard():
        one = Disturbance("", Of.THING, kind, name, vector(by))
        ordered(one, at, for_, within, target, run_dir, form)


def ordered(
    one: Disturbance,
    at: str,
    for_s: float,
    within_s: float,
    target: str,
    run_dir: Path | None,
    form: Format,
) -> None:
    """Do a disturbance from its order to its end, and tell what came of it."""
    fleet = targets.find(target, run_dir)
    inflict.refuse(fleet)
    if wrong := disturbances.wrong(one):
        raise UsageError(wrong)
    possible(fleet, one)
    process = EYE if one.of is Of.CAMERA else LOOP
    moment = moments.parse(at, fleet.system.design, process)
    heal_left(fleet, form)
    fault = inflict.planned(
        fleet, KIND[one.of], process, moments.moment_text(moment), what=described(one)
    )
    wait = partial(moments.wait, moment, within_s, target, run_dir)
    begun = print if form is Format.TEXT else lambda text: None
    kind = _kind(replace(one, id=fault.id), for_s)
    ended = inflict.Inflicting(fleet, fault, kind).run(wait, for_s, begun)
    if form is Format.JSON:
        tell_json(ended)
    else:
        print(f"{ended.words}: {ended.text}, {lasted(ended):.1f} s")


def possible(fleet: Target, one: Disturbance) -> None:
    """Raise FleetError or UsageError where this fleet has nothing that could be disturbed so."""
    if not fleet.read(LOOP, WIRES_FILE):
        raise FleetError(
            f"{fleet.where} was started without --faults; start the fleet with `roco up --faults`"
        )
    if fleet.variable(LOOP, BACKEND) == "mock":
        raise UsageError(
            "the back-end mock has neither senses nor things; the fleet needs the back-end mujoco"
        )
    if one.of is Of.CAMERA and fleet.variable(EYE, EYES) == Eyes.RAYS:
        raise UsageError(
            "this robot sees by rays, it has no camera; start the fleet with `roco up --eyes"
            " pixels`"
        )
    if one.of is Of.THING:
        there = takeable_objects(fleet)
        if one.on not in there:
            raise UsageError(
                f"no thing {one.on!r} can be moved; there are {', '.join(there) or 'none'}"
            )


def takeable_objects(fleet: Target) -> list[str]:
    """The things of the fleet's scene that can be taken."""
    file = fleet.variable(LOOP, SCENE)
    try:
        world = scene.load(Path(file)) if file else scene.load()
    except VelmaError as error:
        raise FleetError(f"the scene of {fleet.where} cannot be read any more: {error}") from error
    return [one.id for one in world.of(*MOVEABLE)]


def vector(text: str) -> tuple[float, ...]:
    """The three numbers of "0,-0.05,0"; () for "". Raise UsageError."""
    try:
        numbers = tuple(float(one) for one in text.split(",")) if text else ()
    except ValueError:
        numbers = (0.0,)
    if len(numbers) not in (0, 3):
        raise UsageError(f"--by {text}: three numbers with commas between, as 0,-0.05,0")
    return numbers


def described(one: Disturbance) -> str:
    """A disturbance in words: "wrist zero left", "encoder bias left_arm_3_joint by 0.05"."""
    by = f"by {','.join(f'{x:g}' for x in one.by)}" if one.by else ""
    parts = (one.on, one.kind, by) if one.of is Of.THING else (one.of, one.kind, one.on, by)
    return " ".join(filter(None, parts))


def _kind(one: Disturbance, for_s: float) -> Kind:
    """The kind of a fault that is this disturbance."""
    return _row(lambda fleet, _: _write(fleet, one.id, (replace(one, until=time.time() + for_s),)))


def _row(begin: Callable[[Target, Fault], None]) -> Kind:
    return Kind(
        begin, lambda seen, fault: "", lambda fleet, fault: _write(fleet, fault.id, ()), FOR_S
    )


def _write(fleet: Target, name: str, instead: tuple[Disturbance, ...]) -> None:
    """Put this in place of what stands under a name in the file, and leave out what has ended by
    itself.
    """
    before, now = disturbances.decoded(fleet.read(LOOP, DISTURBANCES_FILE)), time.time()
    lasting = (one for one in before if one.until is None or one.until > now)
    others = tuple(one for one in lasting if one.id != name)
    if (after := (*others, *instead)) != before:
        fleet.put(DISTURBANCES_FILE, disturbances.encoded(after))


KIND = dict.fromkeys(SENSES, "sensor") | {Of.THING: "thing"}
KINDS = dict.fromkeys(KIND.values(), _row(lambda fleet, fault: None))
"""What heals a fault whose command is gone."""
