"""The report says what was recorded: counts are direct counts, what is missing is named."""

import base64
import copy
import os
from collections import Counter
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import Run, with_signals

from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from companion.languages.cmd import Sentence
from companion.tasks.look_around.command import LookAround
from companion.telemetry import Picture
from companion.tools.report import page, plans, report
from companion.tools.system import SYSTEM
from fipa_codec.communicate import encode
from fipa_codec.performatives import Performative as P
from operate.file_names import TRAFFIC_FILE
from operate.recording import history, mcap_file
from operate.recording.recorder import Recorder
from operate.recording.records import Garbage, House, Origin, Record, Spoken, understood
from operate.recording.run import Run as RecordedRun
from operate.reports.make import everything

SLOW = (("km", "pl"), ("pl", "co"), ("co", "hi"))


def records(samples: list[Sample]) -> list[Record]:
    """Return the recorder's records of samples."""
    return [understood(sample, SYSTEM) for sample in samples]


def record(samples: list[Sample], run: Path) -> None:
    """Record samples in a run folder."""
    recorder = Recorder(run, SYSTEM)
    for sample in samples:
        recorder.take(sample)
    recorder.finish()


def figures(samples: list[Sample]) -> report.Report:
    """The report of these samples."""
    return report.build(history.of_records(records(samples), SYSTEM))


def test_the_main_job_is_told_as_it_was_made(pouring: Run) -> None:
    """Totals, matrix and bytes are those of the communicates that were said."""
    told = figures(pouring.samples)
    matrix = Counter((m.sender, m.receiver) for m in pouring.said)
    sizes: Counter[str] = Counter()
    for message in pouring.said:
        sizes[DESIGN.rule(message).channel] += len(encode(message))
    assert told.communicates.total == len(pouring.said)
    rows = told.communicates.matrix.items()
    assert {(s, r): n for s, row in rows for r, n in row.items() if n} == matrix
    assert {channel: n for channel, n in told.communicates.bytes.items() if n} == sizes
    assert told.success
    assert told.failure is None
    assert told.missing == ()
    assert [plan.queries for plan in told.plans] == [320, 22]
    assert [plan.ended for plan in told.plans] == ["Replan", "Succeeded"]


def test_the_events_are_those_of_table_7_in_their_order(pouring: Run) -> None:
    """Every row of the paper's time table is found in a run of the main job, in the paper's
    order.
    """
    from companion.tools.report.report import PAPER

    names = [event.id for event in figures(pouring.samples).events]
    assert [name for name in names if name in PAPER.times] == list(PAPER.times)


def test_simulated_time_counts_acts_only(pouring: Run) -> None:
    """Simulated seconds of acts are those the run let pass in them, to a sample of telemetry for
    each act.
    """
    told, past = figures(pouring.samples), history.of_records(records(pouring.samples), SYSTEM)
    assert told.sim_time_s == pytest.approx(pouring.sim, abs=0.05 * len(plans.acts(past)))


@settings(max_examples=4, deadline=None)
@given(st.data())
def test_copies_count_once_and_order_on_the_wire_does_not_matter(
    pouring: Run, data: st.DataObject
) -> None:
    """Re-sent communicates change nothing but the number of copies."""
    said = [s for s in pouring.samples if "/_/" not in s.key]
    again = data.draw(st.lists(st.sampled_from(said), max_size=20))
    late = [msgspec.structs.replace(sample, at=sample.at + 0.2) for sample in again]
    told = figures(sorted([*pouring.samples, *late], key=lambda sample: sample.at)).communicates
    assert told.copies == len(late)
    assert told.total == len(pouring.said)
    assert sum(told.bytes.values()) == sum(len(s.data) for s in said)


@settings(max_examples=100, deadline=None)
@given(
    st.binary(max_size=300),
    st.sampled_from(["roco/roco/C1/co/ta/coordinate/request", "roco/roco/_/telemetry/ex", "x"]),
)
def test_garbage_harms_nobody_and_is_counted(data: bytes, key: str) -> None:
    """Any bytes on any key are recorded; on a communicate's key they are garbage."""
    record = understood(Sample(key, data, 1.0), SYSTEM)
    assert isinstance(record, Garbage) or "/_/" in key
    told = report.build(history.of_records([record], SYSTEM))
    assert told.communicates.garbage == isinstance(record, Garbage)
    assert not told.success


def test_plans_wait_until_answers_are_heard(pouring: Run) -> None:
    """km's answers reach pl a quarter of a second later, and so do plans co, and the end of the
    task the person.
    """
    heard, late = records(pouring.samples), 0.25

    def reached(after: float) -> report.Report:
        some: list[Record] = []
        for one in heard:
            if isinstance(one, Spoken) and (one.sender, one.receiver) in SLOW:
                later = msgspec.structs.replace(one, received=one.received + after)
                some.append(later.read_in(SYSTEM.languages))
            else:
                some.append(one)
        return report.build(history.of_records(sorted(some, key=lambda one: one.received), SYSTEM))

    before, told = reached(0.0), reached(late)
    assert told.wall_time_s == pytest.approx((before.wall_time_s or 0.0) + late)
    for first, then in zip(before.plans, told.plans, strict=True):
        assert then.wall_s == pytest.approx((first.wall_s or 0.0) + late)
        assert then.km_s == pytest.approx(first.km_s + first.queries * late)


def test_what_nobody_took_is_named(pouring: Run) -> None:
    """A communicate that its receiver did not step on is a hole."""
    some = records(pouring.samples)
    for n, one in enumerate(some):
        if isinstance(one, Spoken) and one.receiver == "hi":
            lost = msgspec.structs.replace(one, origin=Origin.SENDER)
            some[n] = lost.read_in(SYSTEM.languages)
    past = history.of_records(some, SYSTEM)
    assert [hole.communicates for hole in past.holes] == [2]
    assert "to hi" in past.holes[0].text


def test_a_recording_cut_off_anywhere_is_readable_up_to_there(pouring: Run, tmp_path: Path) -> None:
    """Records flushed before a kill are read, in order, and nothing else; the report names the
    hole.
    """
    record(pouring.samples, tmp_path)
    path = tmp_path / TRAFFIC_FILE
    whole = mcap_file.read(path)
    assert whole.whole
    assert list(whole.records) == records(pouring.samples)
    data = path.read_bytes()
    for share in (0.0, 0.001, 0.1, 0.93, 0.9999):
        path.write_bytes(data[: int(share * len(data))])
        part = mcap_file.read(path)
        assert not part.whole, share
        assert part.records == whole.records[: len(part.records)], share
        assert share < 0.9 or len(part.records) > 0.85 * len(whole.records)
    assert any("was killed" in hole.text for hole in RecordedRun(tmp_path, SYSTEM).history.holes)


def test_the_report_is_made_of_a_run_folder_without_a_fleet(pouring: Run, tmp_path: Path) -> None:
    """report.json, report.html and run.rrd come from the recording alone; the page needs nothing
    from elsewhere.
    """
    record(pouring.samples, tmp_path)
    said: list[str] = []
    made = everything(RecordedRun(tmp_path, SYSTEM), lambda event, **_: said.append(event))
    assert made, said
    told = msgspec.json.decode((tmp_path / "report.json").read_bytes())
    assert told["success"] is True
    assert told["communicates"]["matrix"]["pl"]["km"] == 342
    assert set(told["loop"]["lateness_us"]) == {"p50", "p99", "p999", "max"}
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") == 5
    assert "src=" not in page
    assert "http" not in page.replace("http://www.w3.org", "")
    assert (tmp_path / "run.rrd").stat().st_size > 100_000


def test_a_guest_that_spoke_is_in_the_report(pouring: Run, tmp_path: Path) -> None:
    """Its words are counted beside those of agents, and judged; every file is made."""
    run = copy.deepcopy(pouring)
    talk = {"talk": "assistant-1", "protocol": "query"}
    run.say("assistant", "hi", P.QUERY_REF, Sentence("look around"), **talk)
    run.say("hi", "assistant", P.INFORM_REF, LookAround(), **talk)
    record(run.samples, tmp_path)
    said: list[str] = []
    assert everything(RecordedRun(tmp_path, SYSTEM), lambda event, **_: said.append(event)), said
    told = msgspec.json.decode((tmp_path / "report.json").read_bytes())
    matrix = told["communicates"]["matrix"]
    assert (matrix["assistant"]["hi"], matrix["hi"]["assistant"]) == (1, 1)
    assert told["communicates"]["per_channel"]["G1"]["count"] == 2
    against = told["judged"]["violations"]  # what is made here for agents is not all in sequence
    assert "assistant" not in {name for one in against for name in (one["sender"], one["receiver"])}


def test_what_is_newer_than_the_recording_is_not_drawn_again(pouring: Run, tmp_path: Path) -> None:
    """Unless it is wanted again, or the recording has changed since."""
    record(pouring.samples[:50], tmp_path)
    run, drawn = RecordedRun(tmp_path, SYSTEM), list[str]()

    def made(*, again: bool) -> list[str]:
        drawn.clear()
        everything(run, lambda _, file="", **__: drawn.append(Path(file).name), again=again)
        return drawn[1:]

    assert made(again=False) == ["report.html", "run.rrd"]
    assert made(again=False) == []
    assert made(again=True) == ["report.html", "run.rrd"]
    later = (tmp_path / "run.rrd").stat().st_mtime_ns
    os.utime(tmp_path / TRAFFIC_FILE, ns=(later, later))
    assert made(again=False) == ["report.html", "run.rrd"]


def test_an_empty_folder_gives_a_report_that_says_so(tmp_path: Path) -> None:
    """With nothing recorded there is a report without a single figure, and a reason for each."""
    assert everything(RecordedRun(tmp_path, SYSTEM), lambda *_, **__: None)
    told = msgspec.json.decode((tmp_path / "report.json").read_bytes())
    assert told["success"] is False
    assert told["poured_fraction"] is None
    assert len(told["missing"]) == 7


def test_the_page_shows_the_robot_and_says_what_each_colour_means(pouring: Run) -> None:
    """The last picture of the room, if there is any; every colour of a bar has a name."""
    past = history.of_records(records(pouring.samples), SYSTEM)
    bars = {bar.colour for bar in page.bars(past)}
    assert bars <= {colour for _, colour in page.LEGEND}
    assert len({name for name, _ in page.LEGEND}) == len({colour for _, colour in page.LEGEND})
    shown = (
        msgspec.msgpack.encode(Picture(1.0, b"camera", one)) for one in (b"first", b"last", b"")
    )
    told = (House("telemetry", "ex", "", past.begin + k, one) for k, one in enumerate(shown))
    seen = with_signals(past, *past.signals.houses, *told)
    text = page.rendered(seen, report.build(seen), "run")
    assert f'src="data:image/jpeg;base64,{base64.b64encode(b"last").decode()}"' in text
    assert "<img" not in page.rendered(past, report.build(past), "run")
