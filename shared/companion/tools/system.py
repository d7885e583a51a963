"""The Robot Companion as the tools see it: processes, words, and what it adds to the tools of any
system.
"""

from pathlib import Path

from companion.acts import SHOWN
from companion.design import DESIGN, LANGUAGES
from companion.languages.hfsm import Place
from companion.languages.hfsm import Step as PlanStep
from companion.languages.values import Side
from companion.run_files import DISTURBANCES_FILE, SLOTS_FILE
from companion.sentences import about, at, happened, plain, why
from operate.live_lines import Step
from operate.system import FIRST, Additions, Job, Process, System, around


def step(one: Step) -> str:
    """What a state of a plan does, as live.jsonl has it."""
    side = Side(one.side) if one.side in list(Side) else None
    return at(Place(one.path, PlanStep(one.does, one.things, side) if one.does else None, one.act))


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


EX_WORKERS = tuple(f"services.executor.{name}_process" for name in ("skill", "renderer"))
# Loop and agent of ex are siblings: each may die and come back without the other.
PROCESSES = (
    *around("services.router", "services.monitor"),
    Process(LOOP, "services.executor.loop", forked=False),
    Process("km", "services.knowledge", after=FIRST),
    Process("pl", "services.planner", after=FIRST, workers=("services.planner.search",)),
    Process("ta", "services.task", after=FIRST),
    Process("ex", "services.executor", after=(*FIRST, LOOP), workers=EX_WORKERS),
    Process("co", "services.coordinator", after=FIRST),
    Process("hi", "services.human_interface", after=FIRST),
    Process("page", "services.page", after=("router",), optional=True),
)

SAYS = {
    LOOP: {
        "": "holds still",
        "motion": "holds still",
        "damping": "damps the joints",
        "hold": "holds the joints",
        "stopped": "stopped by a person",
        **{act.__name__: row.says for act, row in SHOWN.items()},
    }
}

JOB = Job(
    command=("demo", "--headless"),
    phases={
        "spoken": "event:command-received",
        "planning": "event:plan-requested 1",
        "approaching": "plan:take jar_1/MoveJoint",
        "closing": "plan:take jar_1/Grasp",
        "lifted": "plan:take jar_1/MoveCartesian",
        "carrying": "plan:carry jar_1/MoveJoint",
        "second grasp": "plan:take bowl_1/Grasp",
        "putting down": "plan:place bowl_1/Release",
        "looking": "plan:look-at bowl_1/Look",
        "replanning": "event:plan-requested 2",
        "pouring": "plan:pour jar_1 bowl_1/Pour",
        "finished": "event:poured jar_1 bowl_1",
    },
    rests={name: (*agent.rest, agent.initial)[0] for name, agent in DESIGN.agents.items()},
    # estimate: a pour takes 30-50 s on two cores of its own, 240 s at a load of 24; co waits 600 s
    timeout_s=900.0,
)

SYSTEM = System(
    name="roco",
    design=DESIGN,
    languages=LANGUAGES,
    processes=PROCESSES,
    contents=3,  # reasons are facts since 2, steps of plans are typed since 3
    about=about,
    why=why,
    plain=plain,
    step=step,
    happened=happened,
    says=SAYS,
    unreplaced={
        "hi": "its words are those of people, which no recording has",
        "ex": "it acts by the robot's control loop, which does not run in a replay",
    },
    additions=Additions(
        options="companion.tools.system:possible",
        findings="companion.design:agreement_findings",
        live="companion.tools.live:Live",
        events="companion.tools.report.events:events",
        report="companion.tools.report.report:build",
        page="companion.tools.report.page:rendered",
        measures="companion.tools.report.measures:MEASURES",
        drawers="companion.tools.pictures.drawers:drawers",
        blueprint="companion.tools.pictures.drawers:blueprint",
        telemetry="companion.tools.telemetry:DECODERS",
        verbs="companion.tools.verbs.table:VERBS",
        tasks="companion.tools.verbs.hi:tasks",
        checks="companion.tools.verbs.checkup:CHECKS",
        promises="companion.tools.report.verdict:broken",
        why="companion.tools.why:of_task",
        believed="companion.tools.why:believed",
        untouchable="companion.tools.verbs.checkup:untouchable",
        faults="companion.tools.verbs.fault:KINDS",
        ros="companion.tools.ros:Robot",
        guests="companion.tools.assistant:extra",
    ),
    job=JOB,
    variables={
        "ROCO_SLOTS": f"{{run}}/{SLOTS_FILE}",
        "ROCO_DISTURBANCES": f"{{run}}/{DISTURBANCES_FILE}",
    },
    entry="companion.tools.system:SYSTEM",
)
