"""What an experiment knows of a run: the figures that every system's report.json has, and what was
said. Pure.

A file of another version may lack a figure: it is None then, and left out where figures are put
together. A system whose report has more gives a subclass of Figures
(operate.experiments.measures.Measures.figures).
"""

import re
from collections.abc import Callable
from typing import Generic, TypeVar

import msgspec

from operate.recording.history import History
from operate.reports.counts import Communicates, Latency
from operate.structs import alike

SETTING_FILE = "experiment.json"
RESULTS_FILE = "results.jsonl"


class ExperimentSetting(msgspec.Struct, frozen=True):
    """experiment.json: what is repeated, with which seeds, and where. `timeout_s`: wall time of one
    run; `most_load`: a run waits until the machine's load is not above it, 0: it does not. A file
    of another version may lack a field.
    """

    task: str = ""
    runs: int = 0
    seed: int = 0
    speed: str = ""
    scene: str = ""
    timeout_s: float = 0.0
    most_load: float = 0.0
    began: float = 0.0
    version: str = ""
    commit: str = ""
    machine: str = ""
    cores: int = 0
    python: str = ""


class Happened(msgspec.Struct, frozen=True):
    """An event, of these things or numbers, `t` s after the first communicate, `sim_s` on the
    simulation's clock.

    `words`: for people; results before 2026-11-29 have those alone, as `name`.
    """

    name: str
    t: float
    of: tuple[str, ...] = ()
    words: str = ""
    sim_s: float | None = None
    channels: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """Its name with what it is of: `grasped jar_1`."""
        return " ".join((self.name, *self.of))


class Figures(msgspec.Struct, frozen=True):
    """The fields used of a report.json, which has more."""

    success: bool = False
    failure: str | None = None
    communicates: Communicates = Communicates()
    events: tuple[Happened, ...] = ()
    latency: tuple[Latency, ...] = ()
    seed: int | None = None
    speed: str | None = None
    began: float = 0.0

    def happened(self, event: str) -> Happened | None:
        """Return the first event of this id."""
        return next((one for one in self.events if one.id == event), None)


F = TypeVar("F", bound=Figures)


class Result(msgspec.Struct, Generic[F], frozen=True):
    """One run: a line of results.jsonl. `figures` None: it left no report; `failure` None: a
    success.
    """

    seed: int | None
    failure: str | None
    figures: F | None
    began: float = 0.0
    took_s: float | None = None
    timed_out: bool = False
    load: tuple[float, float] | None = None

    @property
    def success(self) -> bool:
        """Whether the run did what it should."""
        return self.failure is None


# --- What was said in a run, as plain rows: sender, receiver, act, subject, size, time ------------


_NUMBERS = re.compile(r"\d+(\.\d+)?")


class SentMessage(msgspec.Struct, frozen=True):
    """A communicate. `t`: s after the first one; `kind`: class of its content; `text`: its content
    in a few words.
    """

    t: float
    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: str
    conversation: str
    kind: str
    size: int
    text: str

    @property
    def meaning(self) -> tuple[str, ...]:
        """The part by which two runs are compared: who says what to whom; numbers, conversation
        names and sizes may differ.
        """
        who = self.sender, self.receiver, self.protocol, self.performative
        return (*who, self.kind, _NUMBERS.sub("#", self.text))


def sent_messages(history: History, words: Callable[[object], str]) -> tuple[SentMessage, ...]:
    """Return the communicates of a history in the order of time; `words`: a content in a few
    words.
    """
    rows = []
    for one in history.said:
        told = {"t": one.received - history.begin, "text": words(one.content)}
        kind = "" if one.content is None else type(one.content).__name__
        rows.append(alike(SentMessage, one, **told, kind=kind))
    return tuple(rows)
