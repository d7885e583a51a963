"""No program reads a sentence: with noise in place of every sentence, the same is said, done, shown and reported."""

from pathlib import Path
from typing import Any

import msgspec
import pytest
from logged_fleet import Logged
from pretended_fleet import Fleet

from companion import sentences
from companion.sentences import Catalogue, Reader
from companion.tools.report import report
from companion.tools.system import SYSTEM
from operate.recording import history
from services.human_interface import offers
from services.page.view import Heard, View, view

POUR = "pour the content of the jar into the bowl"
WORDS = ("fact", "claim", "sensor", "fault", "part", "agent", "task", "furniture", "process")
TEXTS = {"text", "reason", "failure"}
"""Of a report: what a person reads."""


class Noise:
    """Another word each time."""

    def __init__(self) -> None:
        self.said = 0

    def __call__(self, reader: Reader) -> Catalogue:
        """Return the catalogue of a reader, with noise in place of its sentences and words."""
        found = real(reader)
        return msgspec.structs.replace(
            found, **{name: {row: self._word() for row in getattr(found, name)} for name in WORDS}
        )

    def _word(self) -> str:
        self.said += 1
        return f"zq{self.said * 7919 % 10007}"


real = sentences.catalogue
Story = tuple[list[bytes], list[Any], list[View], dict[str, Any], list[tuple[str, int]]]


def story(
    run: Path, *, missing: bool
) -> tuple[list[bytes], list[Any], list[View], dict[str, Any], list[tuple[str, int]]]:
    """Return what was said, hi's tasks, the page, the report and how much `why` tells, of a pour with questions."""
    fleet = Fleet()
    logged = Logged(fleet, run)
    if missing:
        fleet.world.poses.pop("jar_1")
    pages: list[View] = []

    def show() -> bool:
        heard = Heard(hi=True, tasks=fleet.tasks, wishes=offers.wishes(fleet.wires.memory("hi").context))
        pages.extend(view(heard, language) for language in ("en", "pl"))
        return fleet.ended()

    fleet.say("look around")
    fleet.finish()
    fleet.say("what do you see")
    fleet.say(POUR)
    fleet.wires.run(lambda: show() and len(fleet.tasks) > 1 and not fleet.wires.memory("hi").open_tasks)
    fleet.say("why did it fail")
    fleet.wires.run(fleet.at_rest)
    why = [(one.title, len(one.facts)) for one in logged.why(fleet.tasks[-1].task).passages]
    made = msgspec.to_builtins(report.build(history.of(run, SYSTEM)))
    said = [bytes(one.content) for one in fleet.wires.traffic if one.content]
    tasks = [msgspec.structs.replace(one, text="") for one in fleet.tasks]
    logged.close()
    fleet.close()
    return said, tasks, pages, made, why


def wordless(value: Any) -> Any:
    """A report without what a person reads."""
    if isinstance(value, dict):
        return {name: wordless(one) for name, one in value.items() if name not in TEXTS}
    return [wordless(one) for one in value] if isinstance(value, list | tuple) else value


@pytest.mark.timeout(120)
@pytest.mark.parametrize("missing", [False, True], ids=["poured", "no jar"])
def test_noise_changes_nothing_but_what_a_person_reads(
    missing: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each communicate is the same to the byte; so are the tasks, the page's steps and things, and the report."""
    (tmp_path / "plain").mkdir()
    (tmp_path / "noise").mkdir()
    said, tasks, pages, made, why = story(tmp_path / "plain", missing=missing)
    noise = Noise()
    monkeypatch.setattr(sentences, "catalogue", noise)
    noisy = story(tmp_path / "noise", missing=missing)
    assert noise.said
    assert noisy[0] == said
    assert noisy[1] == tasks
    assert [(one.step, one.next, one.things) for one in noisy[2]] == [(one.step, one.next, one.things) for one in pages]
    assert wordless(noisy[3]) == wordless(made)
    assert noisy[4] == why
    assert [task.state for task in tasks][-1] == ("failed" if missing else "done")
