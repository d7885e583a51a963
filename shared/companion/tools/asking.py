"""Messages that km heard in a run, and questions about them, answered by a process that can be
ended.
"""

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from companion.asking import ANSWERER, PREFIXES, Answer, Heard, Question, Term, Triple
from companion.tools.system import SYSTEM
from console.errors import ConsoleError, NoRunError

if TYPE_CHECKING:
    from operate.recording.run import Run

KM = "km"
READING_S = 60.0
"""For the start of the process and the making of the triples, beside the query's own time;
estimate, with room.
"""


class AskError(ConsoleError):
    """A question was not answered: it took too long or too much memory, or what answers is not
    installed.
    """


class Known(msgspec.Struct, frozen=True):
    """Messages to and from km until a time. `begin`: of the run [unix s]; `words`: what was asked,
    for people.
    """

    heard: tuple[Heard, ...]
    begin: float
    words: str


def known(place: "Path | Run", at: float | None = None) -> Known:
    """The knowledge of km from a run folder or a recording, now or `at` seconds after its first
    communicate.
    """
    try:
        from operate.recording.records import Spoken, Token
        from operate.recording.run import opened
    except ModuleNotFoundError as error:
        raise _missing("monitor", error.name or "") from error
    run = opened(place, SYSTEM) if isinstance(place, Path) else place
    spoken = [one for one in run.records if isinstance(one, Spoken)]
    if not spoken:
        raise NoRunError(
            str(run.place),
            f"{run.place} has no communicate; give a run folder, or a recording of `roco record`",
        )
    lives = dict[int, float]()
    for one in run.records:
        if isinstance(one, Token) and one.agent == KM and one.alive:
            lives.setdefault(one.incarnation, one.received)
    begin, end = spoken[0].received, spoken[-1].received
    until = end if at is None else begin + at
    heard = [Heard(one.received, one.wire) for one in spoken if KM in (one.sender, one.receiver)]
    heard += [Heard(when) for when in lives.values()]
    kept = tuple(sorted((one for one in heard if one.at <= until), key=lambda one: one.at))
    end_s = end - begin
    when = f"{end_s:.1f} s, the last communicate" if at is None else f"{at:g} of {end_s:.1f} s"
    return Known(kept, begin, f"as km knew it at {when}")


def answered(question: Question) -> Answer:
    """The answer. Raise AskError where there is none in time."""
    command = [sys.executable, "-P", "-m", ANSWERER]
    try:
        longest, data = question.seconds + READING_S, msgspec.msgpack.encode(question)
        done = subprocess.run(
            command, input=data, capture_output=True, timeout=longest, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise AskError(
            f"reading what km was told took more than {READING_S:.0f} s; ask of an earlier --at"
        ) from error
    if done.returncode == -signal.SIGALRM:
        raise AskError(
            f"the query was ended after {question.seconds:g} s; bind more of its variables, or give"
            " --seconds more"
        )
    if done.returncode:
        raise _ended(done.returncode, done.stderr.decode(errors="replace").strip())
    told: Answer = msgspec.msgpack.decode(done.stdout, type=Answer)
    return told


def _ended(code: int, said: str) -> AskError:
    last = said.splitlines()[-1] if said else f"it ended with {code}"
    if "ModuleNotFoundError" in last:
        return _missing("knowledge", last.rpartition("'")[0].rpartition("'")[2])
    if code == -signal.SIGABRT or "MemoryError" in last:
        return AskError(
            "the query needs too much memory; bind more of its variables, or sort and group less"
        )
    return AskError(f"the process that answers has died: {last}")


def _missing(extra: str, module: str) -> AskError:
    return AskError(
        f"{module} is not installed; `pip install 'robot-companion[{extra}]'` installs it"
    )


def short(term: Term) -> str:
    """A value for people: an IRI with its prefix, as it may be written in a question."""
    return written(term, _prefixed)


def written(term: Term, iri: Callable[[str], str] = str) -> str:
    """A value in one line; `iri` writes an IRI."""
    match term.value:
        case Triple(subject, predicate, about):
            return f"<<( {' '.join(written(one, iri) for one in (subject, predicate, about))} )>>"
        case value if term.type == "uri":
            return iri(value)
        case value:
            return f"_:{value}" if term.type == "bnode" else value


def _prefixed(iri: str) -> str:
    for prefix, space in PREFIXES.items():
        if iri.startswith(space):
            return f"{prefix}:{iri.removeprefix(space).replace('/', chr(92) + '/')}"
    return f"<{iri}>"
