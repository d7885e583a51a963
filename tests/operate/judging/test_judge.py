"""The judge in the monitor: while traffic goes by and afterwards it says the same, in file, log,
report and page.
"""

import random
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import pytest
from planting import PLANTS, POUR, Traffic

from agent_runtime.io.tap import Sample
from companion.tools.report import report
from companion.tools.system import SYSTEM
from operate.file_names import LIVE_FILE, VERDICTS_FILE
from operate.judging.judged import of_live
from operate.live_lines import Against, LiveLine, Sent
from operate.recording import history
from operate.recording.recorder import Recorder
from operate.recording.records import Setting, Token, understood
from operate.recording.run import Run, verdicts
from operate.reports.make import everything
from operate.system import NoSystemError, languages_at, of_design
from operate.verdict_lines import Judged
from topdown.judge.verdicts import VIOLATIONS, Verdict

PLANTED = (
    "km answers in a conversation that nobody opened",
    "no_communicate",
    "a query has twice the size that its class may have",
)


def wrong() -> Traffic:
    """The pour with three violations."""
    traffic = Traffic()
    for why in PLANTED:
        PLANTS[why](traffic)
    return traffic


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, Any]]]:
    """A run folder that a recorder wrote, and what it logged."""
    run, log = tmp_path_factory.mktemp("run"), []
    recorder = Recorder(run, SYSTEM, lambda event, **fields: log.append({"event": event, **fields}))
    for item in wrong().items:
        if isinstance(item, Sample):
            recorder.take(item)
    recorder.finish()
    return run, log


def lines(path: Path, kind: Any) -> list[Any]:
    """The lines of a file."""
    return [msgspec.json.decode(line, type=kind) for line in path.read_bytes().splitlines()]


def test_verdicts_are_written_as_they_come(told: tuple[Path, list[dict[str, Any]]]) -> None:
    """A line for each communicate; the violations are in the log, as warnings, and among the lines
    for people.
    """
    run, log = told
    verdicts = lines(run / VERDICTS_FILE, Judged)
    assert len(verdicts) == sum(isinstance(item, Sample) for item in wrong().items)
    against = {one.verdict for one in verdicts if one.violation}
    # the recorder began after its agents as far as it knows, so an answer to nothing is none of its
    # business
    assert against == {Verdict.MALFORMED, Verdict.OVER_BUDGET}
    assert [(one["event"], one["level"]) for one in log] == [("not as designed", "warning")] * 2
    assert {one["verdict"] for one in log} == against
    assert all(one["why"] for one in log)
    shown = [line for line in lines(run / LIVE_FILE, LiveLine) if isinstance(line, Against)]
    assert {line.verdict for line in shown} == against


def test_afterwards_the_same_is_said(told: tuple[Path, list[dict[str, Any]]]) -> None:
    """The recording judged again gives the lines that were written while it was made."""
    run, _ = told
    written = sorted(lines(run / VERDICTS_FILE, Judged), key=lambda one: one.t)
    assert list(verdicts(run, SYSTEM)) == written


def test_lines_for_people_can_be_judged_too(told: tuple[Path, list[dict[str, Any]]]) -> None:
    """live.jsonl has what sequence, size and entitlement need; what was no communicate of the
    design is not in it.
    """
    found = verdicts(told[0] / LIVE_FILE, SYSTEM)
    assert {one.verdict for one in found if one.violation} == {Verdict.OVER_BUDGET}
    assert sum(one.verdict == Verdict.COPY for one in found) == 4


def test_live_lines_of_an_earlier_version_are_not_judged(
    told: tuple[Path, list[dict[str, Any]]],
) -> None:
    """They say neither ids nor labels: what cannot be followed by them is not called wrong."""
    sent = [line for line in lines(told[0] / LIVE_FILE, LiveLine) if isinstance(line, Sent)]
    old = [msgspec.structs.replace(line, id="", reply_with="", in_reply_to="") for line in sent]
    assert {one.verdict for one in of_live(old, SYSTEM.design)} == {Verdict.NOT_JUDGED}
    assert len(of_live(old, SYSTEM.design)) == len(old)


def test_the_report_tells_what_was_against_the_design() -> None:
    """Counts of each verdict, and of each violation when, where and why; nothing where all is
    well.
    """
    past = history.of_records([_known(item) for item in wrong().items], SYSTEM)
    judged = report.build(past).judged
    assert judged is not None
    kinds = {"out of sequence", "malformed", "over budget"}
    assert {one.verdict for one in judged.violations} == kinds
    assert sum(judged.verdicts.values()) == judged.communicates == 426
    assert all(one.why and one.t > 0 for one in judged.violations)
    clean = report.build(Run(POUR.parent, SYSTEM).history).judged
    assert clean is not None
    assert clean.violations == ()


def test_the_page_shows_it(tmp_path: Path) -> None:
    """The section says that all is as designed, or lists what is not."""
    from companion.tools.report import page

    past = Run(POUR.parent, SYSTEM).history
    text = page.rendered(past, report.build(past), "one is slow")
    assert "Nothing against the design; 1 of 424 communicates slow." in text
    assert "communicates as designed" not in text
    legal = tuple(msgspec.structs.replace(one, verdict="legal") for one in past.judged)
    past = msgspec.structs.replace(past, judged=legal)
    assert "All 424 communicates as designed." in page.rendered(past, report.build(past), "clean")
    past = history.of_records([_known(item) for item in wrong().items], SYSTEM)
    text = page.rendered(past, report.build(past), "wrong")
    assert "3 of 426 communicates are not as designed." in text
    assert "nothing opened conversation pl-1-900" in text


def test_a_recorder_that_began_first_knows_beginnings(tmp_path: Path) -> None:
    """Told when it began, it can say that nothing opened a conversation between agents that were
    born since.
    """
    recorder = Recorder(tmp_path, SYSTEM)
    recorder.begin(Setting(seed=7, speed="1"))
    recorder.finish()
    assert (tmp_path / VERDICTS_FILE).read_bytes() == b""
    assert everything(Run(tmp_path, SYSTEM), lambda *_, **__: None)


def test_another_systems_design_and_languages_are_named(tmp_path: Path) -> None:
    """A design file that is none, and languages that are none, are errors that say what to
    write.
    """
    (tmp_path / "no.toml").write_text("x = 1")
    with pytest.raises(NoSystemError, match=r"no\.toml"):
        of_design(tmp_path / "no.toml")
    for place in ("companion.languages", "companion.languages:NOTHING", "companion.design:DESIGN"):
        with pytest.raises(NoSystemError, match=place):
            languages_at(place)
    assert languages_at("companion.design:LANGUAGES") is SYSTEM.languages


def _known(item: Any) -> Any:
    return understood(item, SYSTEM) if isinstance(item, Sample) else item


# --- A whole recorded run with planted violations -------------------------------------------------


MISSED_S, NOTICED_S = 0.9, 2.0
"""A gap in what a sender said is noticed at its next heartbeat but one."""
UNTOLD_S = 0.02
"""Delay within which each communicate is heard here [s]; on one host it is less than a ms."""


def test_a_whole_run_is_as_designed() -> None:
    """Every communicate of the pour is judged, none is against the design, and none is left
    unjudged.
    """
    traffic = Traffic()
    verdicts = Counter(traffic.verdicts())
    assert traffic.found() == []
    assert sum(verdicts.values()) == sum(isinstance(item, Sample) for item in traffic.items)
    assert verdicts["copy"] == 4
    assert verdicts[Verdict.NOT_JUDGED] == 0


def test_there_are_plants_of_every_verdict() -> None:
    """At least twenty, and each kind of violation that one communicate shows
    (tests/operate/recording/test_ends.py has those that two logs show).
    """
    assert len(PLANTS) >= 20
    found = {plant(Traffic())[0] for plant in PLANTS.values()}
    assert found == VIOLATIONS - {Verdict.NOT_SAID, Verdict.ALTERED}


@pytest.mark.parametrize("why", PLANTS)
def test_a_planted_violation_is_found_and_named(why: str) -> None:
    """The right verdict about the right communicate, and nothing else is flagged."""
    traffic = Traffic()
    expected = PLANTS[why](traffic)
    assert traffic.found() == [expected]


@pytest.mark.parametrize("part", range(1, 12))
def test_who_begins_in_the_middle_alarms_about_nothing(part: int) -> None:
    """Communicates after a start in the middle are as designed, or not judged."""
    traffic = Traffic()
    cut = part * len(traffic.items) // 12
    traffic.items = [
        item for n, item in enumerate(traffic.items) if n >= cut or isinstance(item, Token)
    ]
    assert traffic.found() == []


@pytest.mark.parametrize("seed", range(10))
def test_the_order_of_hearing_need_not_be_that_of_saying(seed: int) -> None:
    """A stream keeps its order; all else may be heard some ms sooner or later than the other side's
    words.
    """
    traffic, chance = Traffic(), random.Random(seed)
    last: dict[tuple[str, ...], float] = {}
    for n, item in enumerate(traffic.items):
        if isinstance(item, Sample):
            pair = tuple(item.key.split("/")[3:5])
            last[pair] = at = max(last.get(pair, 0.0), item.at + chance.uniform(0.0, UNTOLD_S))
            traffic.items[n] = msgspec.structs.replace(item, at=at)
    traffic.items.sort(key=lambda item: item.at if isinstance(item, Sample) else item.received)
    assert traffic.found() == []


@pytest.mark.parametrize("nth", range(1, 99, 4))
def test_a_number_that_was_not_heard_is_no_violation(nth: int) -> None:
    """Of a durable stream nobody can skip a number: the tap missed it, and what it was about is not
    judged.
    """
    traffic = Traffic()
    keys = [item.key.split("/") if isinstance(item, Sample) else [] for item in traffic.items]
    durable = [n for n, key in enumerate(keys) if key[2:3] in (["C1"], ["C2"], ["C5"])]
    traffic.remove(durable[nth])
    assert traffic.found() == []
    assert Verdict.NOT_JUDGED in traffic.verdicts()
