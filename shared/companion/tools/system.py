"""The Robot Companion as the tools see it: processes, words, and what it adds to the tools of any system."""

from companion.design import DESIGN
from companion.languages import LANGUAGES
from companion.run_files import SLOTS_FILE
from companion.wording import words
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

SYSTEM = System(
    name="roco",
    design=DESIGN,
    languages=LANGUAGES,
    processes=PROCESSES,
    words=words,
    additions=Additions(
        options="companion.tools.scenes:possible",
        findings="companion.findings:agreement_findings",
        live="companion.tools.live:Live",
        events="companion.tools.report.events:events",
        report="companion.tools.report.report:build",
        page="companion.tools.report.page:rendered",
        drawers="companion.tools.pictures.drawers:drawers",
        blueprint="companion.tools.pictures.blueprint:blueprint",
        telemetry="companion.tools.telemetry:DECODERS",
    ),
    variables={"ROCO_SLOTS": f"{{run}}/{SLOTS_FILE}"},
    entry="companion.tools.system:SYSTEM",
)
