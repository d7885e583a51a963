"""The Robot Companion as the tools see it: processes, words, and what it adds to the tools of any
system.
"""

from companion.all_languages import LANGUAGES
from companion.design import DESIGN
from companion.run_files import DISTURBANCES_FILE, SLOTS_FILE
from companion.sentences import about, happened, plain, why
from companion.tools.shown import SHOWN, step
from operate.system import FIRST, Additions, Job, Process, System, around

EX_WORKERS = tuple(f"services.executor.{name}_process" for name in ("skill", "renderer"))
# Loop and agent of ex are siblings: each may die and come back without the other.
PROCESSES = (
    *around("services.router", "services.monitor"),
    Process("loop", "services.executor.loop", forked=False),
    Process("km", "services.knowledge", after=FIRST),
    Process("pl", "services.planner", after=FIRST, workers=("services.planner.search",)),
    Process("ta", "services.task", after=FIRST),
    Process("ex", "services.executor", after=(*FIRST, "loop"), workers=EX_WORKERS),
    Process("co", "services.coordinator", after=FIRST),
    Process("hi", "services.human_interface", after=FIRST),
    Process("page", "services.page", after=("router",), optional=True),
)

SAYS = {
    "loop": {
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
        options="companion.tools.scenes:possible",
        findings="companion.findings:agreement_findings",
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
        promises="companion.tools.promises:broken",
        why="companion.tools.why:passages",
        believed="companion.tools.why:believed",
        untouchable="companion.tools.verbs.checkup:untouchable",
        faults="companion.tools.verbs.fault:KINDS",
    ),
    job=JOB,
    variables={
        "ROCO_SLOTS": f"{{run}}/{SLOTS_FILE}",
        "ROCO_DISTURBANCES": f"{{run}}/{DISTURBANCES_FILE}",
    },
    entry="companion.tools.system:SYSTEM",
)
