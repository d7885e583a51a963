"""A run as all tools ask it: its records are read once, and what is made of them is made when it is
first asked for.

A communicate is taken from the agents' step logs; from the recording only where a run folder has no
logs, or where a recording stands alone. So it does not matter when the recorder began, or whether
it lived. Must not know: what a tool wants of it.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path

import msgspec

from agent_runtime.io.tap import Sample
from operate.doing import doing
from operate.fault_lines import FaultFile, done
from operate.file_names import FLEET_FILE, LIVE_FILE, STEPS, TRAFFIC_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.judging import judged
from operate.live_lines import LiveLine
from operate.recording import history, mcap_file, traced
from operate.recording.ends import RECEIPT, Ends
from operate.recording.history import History
from operate.recording.index import NoRecordingError
from operate.recording.mcap_file import Read
from operate.recording.records import (
    HEARTBEAT,
    Garbage,
    House,
    Record,
    Spoken,
    Unpaired,
    sampled,
)
from operate.structs import NothingToRead, alike
from operate.system import System, of_run
from operate.tracing.reasons import Why, absent, content_text, ending
from operate.tracing.trace import Span, Trace
from operate.verdict_lines import Judged
from topdown.check.recorded import Observation, Observed

HOUSES, LOGGED = "house", ("communicates", "unpaired")
"""Topics (mcap_file.topic) of samples that are no communicates; of what agents' logs have."""
NOT_UP = (ProcessState.GIVEN_UP, ProcessState.BACKING_OFF)


class Run:
    """A run folder, or a recording (.mcap) alone. What cannot be read is left out.

    A recording of another version raises NoRecordingError.
    """

    def __init__(self, place: Path, system: System | None = None, *, words: bool = True) -> None:
        """`system`: else the one that the run names. `words`: records and verdicts have contents
        in a few words, for viewers; else only where the recorder was killed, and verdicts.jsonl is
        made again.
        """
        self.place, self.system = place, of_run(place) if system is None else system
        self._words = words

    @cached_property
    def recorded(self) -> Read:
        """The records in the order of time, and whether the recorder ended in order."""
        return self._read(lambda topic: True, words=self._words)

    def _read(self, wanted: Callable[[str], bool], *, words: bool = True) -> Read:
        """Read what is on these topics, and what the agents' logs have, with contents in a few
        `words`.
        """
        logged = self.place.is_dir() and any((self.place / STEPS).glob(f"*.{STEPS}"))
        with _at(f"reading {self.place}"):
            found = mcap_file.read(
                self.file,
                self.system,
                (lambda topic: wanted(topic) and not _is_in_logs(topic)) if logged else wanted,
            )
            records = found.records
            if logged:
                ends = Ends(self.place, self.system, words=words)
                for one in records:
                    if isinstance(one, House) and one.kind == HEARTBEAT:
                        ends.lived(one.owner, one.received)
                records = (*(one for one in records if not _is_logged(one)), *ends.rest())
            return Read(_in_order(records), found.whole)

    @property
    def file(self) -> Path:
        """The recording."""
        return self.place / TRAFFIC_FILE if self.place.is_dir() else self.place

    @property
    def records(self) -> tuple[Record, ...]:
        """All that was recorded, in the order of time."""
        return self.recorded.records

    @cached_property
    def judged(self) -> tuple[Judged, ...]:
        """All verdicts about what was said, in the order of time."""
        words = self._words or not self.recorded.whole
        return _judged(self.records, self.system, words=words)

    @cached_property
    def history(self) -> History:
        """What was said, heard and told, with what the files of a run folder tell besides."""
        return self._history(self.recorded, self.judged)

    @cached_property
    def talk(self) -> History:
        """The history without the signals of processes, such as telemetry, which are most of a
        recording: whoever asks what was said need not wait for them.
        """
        if "recorded" in self.__dict__:
            return self.history
        verdicts = _judged(self._talk.records, self.system, words=False)
        return self._history(self._talk, verdicts)

    @property
    def talk_records(self) -> tuple[Record, ...]:
        """The records that `talk` is made of, or all. Their contents may not be in words."""
        return self.records if "recorded" in self.__dict__ else self._talk.records

    @cached_property
    def _talk(self) -> Read:
        return self._read(_is_talk, words=False)

    def _history(self, read: Read, verdicts: tuple[Judged, ...]) -> History:
        with _at("putting the history together"):
            past = history.of_records(
                read.records, self.system, whole=read.whole, verdicts=verdicts
            )
        if not self.place.is_dir():
            return past
        later = FaultFile(self.place).new()  # written while no recorder lived
        faults = done(sorted((*past.faults, *later), key=lambda one: one.t))
        return msgspec.structs.replace(past, down=self._down(), faults=faults)

    @cached_property
    def trace(self) -> Trace:
        """Conversations, and which was opened for the sake of which; of a recording alone all links
        are by time.
        """
        logs = sorted((self.place / STEPS).glob(f"*.{STEPS}")) if self.place.is_dir() else []
        past = self.talk
        with _at("looking for what caused what"):
            return traced.of(self.talk_records, past, logs, self.system)

    def samples(self, *, everything: bool = False) -> Iterator[Sample]:
        """The records as samples; without `everything` communicates, tokens and what was no
        communicate.

        With it also the recorder's own first word, its setting, as if it had been heard.
        """
        for record in self.records:
            if everything or not isinstance(record, House):
                sample = sampled(record, self.system.design)
                if sample is not None:
                    yield sample

    def observed(self) -> Observed:
        """Everything said, each once, and the names of its events, to compare it with a design."""
        events = self.system.addition("events")
        told = () if events is None else events(self.history)
        said = tuple(_observation(one) for one in self.history.said)
        return Observed(communicates=said, events=tuple(event.name for event in told))

    def _down(self) -> tuple[ProcessStatus, ...]:
        """Return the processes that did not run in the end, by the supervisor's file; () without
        one.
        """
        try:
            told = msgspec.json.decode((self.place / FLEET_FILE).read_bytes(), type=Fleet)
        except (OSError, msgspec.DecodeError):
            return ()
        return tuple(one for one in told.processes if one.state in NOT_UP and not one.optional)


def opened(place: Path, system: System | None = None) -> Run:
    """The run at this place. Raise NoRecordingError where it has no record."""
    run = Run(place, system)
    if mcap_file.first(run.file, run.system) is None and not run.records:
        why = "holds no record that can be read" if run.file.is_file() else "is not there"
        raise NoRecordingError(run.file, why)
    return run


def verdicts(place: Path, system: System) -> tuple[Judged, ...]:
    """Every verdict about a run, or about the lines of a live.jsonl where there is no recording.

    Raise NoRecordingError.
    """
    if place.is_dir() and not (place / TRAFFIC_FILE).exists() and (place / LIVE_FILE).exists():
        place /= LIVE_FILE
    if place.suffix != ".jsonl" or not place.is_file():
        return opened(place, system).judged
    lines: list[LiveLine] = []
    decoder = msgspec.json.Decoder(LiveLine)
    for raw in place.read_bytes().splitlines():
        try:
            lines.append(decoder.decode(raw))
        except msgspec.DecodeError:  # of another version
            continue
    return judged.of_live(lines, system.design)


def _in_order(records: tuple[Record, ...]) -> tuple[Record, ...]:
    return tuple(sorted(records, key=lambda one: one.received))


@contextmanager
def _at(words: str) -> Iterator[None]:
    """Be at work on many records. None of them is in a circle: to look for circles among them again
    and again takes an eighth of the time, and finds nothing.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        with doing(words):
            yield
    finally:
        if collects:
            gc.enable()


def _judged(
    records: tuple[Record, ...], system: System, *, words: bool = True
) -> tuple[Judged, ...]:
    with _at(f"judging {len(records)} records"):
        return judged.of_records(records, system, words=words)


def _is_talk(topic: str) -> bool:
    """Whether a topic has what agents say, or what tells of their lives."""
    kind, _, name = topic.partition("/")
    return kind != HOUSES or name in history.NO_SIGNALS


def _is_in_logs(topic: str) -> bool:
    """Whether agents' logs have all that is on a topic."""
    return topic.partition("/")[0] in LOGGED or topic == f"{HOUSES}/{RECEIPT}"


def _is_logged(record: Record) -> bool:
    """Whether agents' logs have it."""
    if isinstance(record, Garbage):
        return bool(record.log)
    receipt = isinstance(record, House) and record.kind == RECEIPT
    return receipt or isinstance(record, Spoken | Unpaired)


def _observation(one: Spoken) -> Observation:
    content = "" if one.content is None else f"{one.language}.{type(one.content).__name__}"
    act = one.communicate.performative
    return alike(
        Observation, one, at=one.received, performative=act, bytes=one.size, content=content
    )


# --- Reasons of a run: of one of its tasks, or of what is believed of a thing ---------------------


WATCH = "subscribe"


class NothingKnown(NothingToRead):
    """Nothing is recorded of what was asked about; it says what may be asked."""


def reasons(run: Run, about: str, at: float | None = None) -> Why:
    """Return the reasons. `at`: beliefs as they were then [s after the first communicate]. Raise
    NothingKnown.
    """
    system = run.system
    tasks = people(run.trace, system)
    span = run.trace.named(about) if about else tasks[-1] if tasks else None
    if span is not None:
        return _of_task(run, span)
    if about and (believed := system.addition("believed")) is not None:
        found: Why | None = believed(run, about, at)
        if found is not None:
            return found
    known = ", ".join(one.id for one in tasks[-8:]) or "none"
    if about:
        thing = ", nor a thing that the system knew" if system.additions.believed else ""
        raise NothingKnown(f"{about!r} is no task of this run{thing}; its tasks are {known}")
    raise NothingKnown(
        f"no task was asked for in {run.place}; give the folder of a run in which one was"
    )


def people(trace: Trace, system: System) -> tuple[Span, ...]:
    """Return what was asked for from outside, oldest first: the conversations opened by agents that
    nobody asks.
    """
    asked = {use.participant for use in system.design.file.protocol}
    return tuple(one for one in trace.roots if one.initiator not in asked and one.protocol != WATCH)


def _of_task(run: Run, span: Span) -> Why:
    more = run.system.addition("why")
    sentence, own = ("", ()) if more is None else more(run, span)
    passages = [ending(run.trace, span), *own, absent(run.trace, span)]
    what, took, last = span.text or span.protocol, span.end - span.start, span.last
    content = f": {content_text(last)}" if content_text(last) else ""
    ended = f"ended after {took:.1f} s with {last.performative}{content}"
    text = f"{what}: {ended if span.ended else f'open for {took:.1f} s'}"
    found = tuple(one for one in passages if one is not None and one.facts)
    return Why(span.id, text, run.trace.begin, found, sentence)
