"""No program reads a sentence: with noise in place of every sentence, the same is said, done, shown
and reported.
"""

from typing import Any, NamedTuple

import msgspec
import pytest
from logged_fleet import LoggedFleet
from msgspec.structs import replace

from companion import sentences
from companion.design import DESIGN
from companion.tools.live import Live
from companion.tools.report import report
from companion.tools.system import JOB, SYSTEM
from console.faults.moments import Event, InPlan, parse
from operate.live_lines import Happened, LiveLine
from operate.recording.run import opened
from services.human_interface import interpretation
from services.page.view import Heard, View, view

POUR = "pour the content of the jar into the bowl"
WORDS = (
    "fact",
    "claim",
    "sensor",
    "fault",
    "part",
    "agent",
    "task",
    "furniture",
    "process",
    "event",
    "step",
    "leaf",
)
TEXTS = {"text", "reason", "failure", "words"}
"""Of a report: what a person reads."""


ASKED = {"spoken", "planning", "replanning"}
"""Phases of a task for which there is no plan."""


class Noise:
    """Another word each time."""

    def __init__(self):
        self.said = 0

    def __call__(self, reader):
        """Return the catalogue of a reader, with noise in place of its sentences and words."""
        found = real(reader)
        return replace(
            found, **{name: {row: self._word() for row in getattr(found, name)} for name in WORDS}
        )

    def _word(self):
        self.said += 1
        return f"zq{self.said * 7919 % 10007}"


real = sentences.catalogue


class Story(NamedTuple):
    """What was said, hi's tasks, the page, the report, how much `why` tells, and the lines of
    live.jsonl.
    """

    said: list[bytes]
    tasks: list[Any]
    pages: list[View]
    report: dict[str, Any]
    why: list[tuple[str, int]]
    lines: list[LiveLine]


def story(run, *, missing):
    """Return the story of a pour with questions."""
    fleet = LoggedFleet(run)
    if missing:
        fleet.world.poses.pop("jar_1")
    pages, shown_last = list[View](), list[Any]()

    def show():
        if shown_last and shown_last[-1] == (fleet.tasks, fleet.wires.memory("hi").context):
            return fleet.ended()
        shown_last.append((fleet.tasks, fleet.wires.memory("hi").context))
        wishes = interpretation.wishes(fleet.wires.memory("hi").context)
        heard = Heard(hi=True, tasks=fleet.tasks, wishes=wishes)
        pages.extend(view(heard, language) for language in ("en", "pl"))
        return fleet.ended()

    fleet.say("look around")
    fleet.finish()
    fleet.say("what do you see")
    fleet.say(POUR)
    fleet.until(lambda: show() and len(fleet.tasks) > 1 and not fleet.wires.memory("hi").open_tasks)
    fleet.say("why did it fail")
    fleet.until(fleet.at_rest)
    why = [(one.title, len(one.facts)) for one in fleet.reasons(fleet.tasks[-1].task).passages]
    past, live = opened(run, SYSTEM).history, Live()
    made = msgspec.to_builtins(report.build(past))
    lines = [replace(line, text="") if isinstance(line, Happened) else line
             for one in past.said for line in live.lines(one)]  # fmt: skip
    said = [bytes(one.content) for one in fleet.wires.traffic if one.content]
    tasks = [replace(one, text="") for one in fleet.tasks]
    fleet.close()
    return Story(said, tasks, pages, made, why, lines)


def begun(lines):
    """Return the phases of the usual task in which a fault may begin, as `roco chaos` finds them in
    these lines.
    """
    moments = {phase: parse(at, DESIGN, "pl") for phase, at in JOB.phases.items()}
    known = {phase: one for phase, one in moments.items() if isinstance(one, Event | InPlan)}
    return {phase for phase, one in known.items() if any(map(one.there, lines))}


def wordless(value):
    """A report without what a person reads."""
    if isinstance(value, dict):
        return {name: wordless(one) for name, one in value.items() if name not in TEXTS}
    return [wordless(one) for one in value] if isinstance(value, list | tuple) else value


def shown(one):
    """The page without what a person reads."""
    return bool(one.step), bool(one.next), one.things


@pytest.mark.timeout(120)
@pytest.mark.parametrize("missing", [False, True], ids=["poured", "no jar"])
def test_noise_changes_nothing_but_what_a_person_reads(missing, tmp_path, monkeypatch):
    """Each communicate is the same to the byte; so are the tasks, the page's things, whether it has
    a step, the report, the lines of live.jsonl, and the phases that chaos finds in them.
    """
    (tmp_path / "plain").mkdir()
    (tmp_path / "noise").mkdir()
    plain = story(tmp_path / "plain", missing=missing)
    noise = Noise()
    monkeypatch.setattr(sentences, "catalogue", noise)
    noisy = story(tmp_path / "noise", missing=missing)
    assert noise.said
    assert noisy.said == plain.said
    assert noisy.tasks == plain.tasks
    assert [shown(one) for one in noisy.pages] == [shown(one) for one in plain.pages]
    assert wordless(noisy.report) == wordless(plain.report)
    assert noisy.why == plain.why
    assert noisy.lines == plain.lines
    # no such acts here
    assert begun(plain.lines) == (ASKED if missing else JOB.phases.keys() - {"lifted", "carrying"})
    assert [task.state for task in plain.tasks][-1] == ("failed" if missing else "done")
