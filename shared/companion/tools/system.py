"""The Robot Companion as the tools see it: processes, words, and what it adds to the tools of any system."""

from companion.design import DESIGN
from companion.languages import LANGUAGES
from companion.run_files import SLOTS_FILE
from companion.wording import plain, words
from operate.supervisor.processes import FIRST, Process, around
from operate.system import Additions, System

# Loop and agent of ex are siblings: each may die and come back without the other.
PROCESSES = (
    *around("services.router", "services.monitor"),
    Process("loop", "services.executor.loop"),
    Process("km", "services.knowledge", after=FIRST),
    Process("pl", "services.planner", after=FIRST),
    Process("ta", "services.task", after=FIRST),
    Process("ex", "services.executor", after=(*FIRST, "loop")),
    Process("co", "services.coordinator", after=FIRST),
    Process("hi", "services.human_interface", after=FIRST),
)

SAYS = {
    "loop": {
        "": "holds still",
        "motion": "holds still",
        "damping": "damps the joints",
        "hold": "holds the joints",
        "stopped": "stopped by a person",
        "MoveJoint": "moves an arm",
        "MoveCartesian": "pulls straight",
        "Grasp": "grasps",
        "Release": "puts down",
        "Look": "looks",
        "Pour": "pours",
        "Home": "moves an arm home",
    },
}

SYSTEM = System(
    name="roco",
    design=DESIGN,
    languages=LANGUAGES,
    processes=PROCESSES,
    words=words,
    plain=plain,
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
        blueprint="companion.tools.pictures.blueprint:blueprint",
        telemetry="companion.tools.telemetry:DECODERS",
        verbs="companion.tools.verbs.table:VERBS",
        tasks="companion.tools.verbs.hi:tasks",
        checks="companion.tools.verbs.checkup:CHECKS",
    ),
    variables={"ROCO_SLOTS": f"{{run}}/{SLOTS_FILE}"},
    entry="companion.tools.system:SYSTEM",
)
