"""The files of a run folder that only this system has: the loop's slots, a_hi's address; and a_hi's
words over HTTP.

docs/http.md is the contract of a_hi, docs/run-folder.md says which process writes which file. Names
and types only.
"""

from typing import Annotated

import msgspec

from companion.languages.evidence import Evidence
from companion.languages.facts import Facts
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side

HI_FILE = "hi.json"
PAGE_FILE = "page.json"
PAGE_KEYS = "page-keys"  # folder of the certificate that the page shows a tablet, mode 0700
REFUSED = "refused"
"""The state of a line on a sentence that never became a task."""
QUESTION, ANSWERED = "question", "answered"
"""The state of a line that asks back, so that no task came of the sentence yet, and of one that
answers a question.
"""
STOPPED, RELEASED = "stopped", "released"
"""The state of a line on a stop, which no agent needs to hear of, and on its end."""
HELD = "stopped: the loop holds the robot until `roco release`"
LET_GO = "released: the loop leaves the stop by its own rules"
LONGEST_WITHIN_S = 86_400.0
"""Until the deadline of a task, or its time to begin; estimate: who says more means neither."""
MOST_EAST_MIN = 24 * 60  # no place is so far ahead of UTC, or behind it
SLOTS_FILE = "loop.slots"  # where ex's agent and its loop meet
# faults of simulated senses and things, for the simulator alone
DISTURBANCES_FILE = "disturbances.json"


class HiAddress(msgspec.Struct, frozen=True):
    """hi.json (mode 0600), written by hi once it listens on 127.0.0.1."""

    port: int
    token: str


class PageAddress(msgspec.Struct, frozen=True):
    """page.json (mode 0600), written by the person's page once it listens on 127.0.0.1; `token` is
    for `roco page`. `tablet`: host:port where it listens with TLS, too, "" for nowhere.
    """

    port: int
    token: str
    tablet: str = ""


class Pairing(msgspec.Struct, frozen=True):
    """Answer of the page to POST /code: a code that pairs one browser, once, and how long it can
    [s].
    """

    code: str
    within_s: float


class Say(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """POST /say: a sentence. `urgency`: higher comes first; `within_s`, `later_s`: seconds until it
    should be done, and until it may begin, 0 for none.

    `instead`: a task that is cancelled as soon as the new one is asked for, such as the same one
    with less urgency. `asker`: the browser or terminal that says it; only the one that hi asked can
    answer its question. `east_min`: how far its clock is ahead of UTC [min]; None: as far as hi's.
    Of hours named in the sentence. `careful`: ask before what cannot be undone.
    """

    text: str
    urgency: Annotated[int, msgspec.Meta(ge=0, le=9)] = 0
    within_s: Annotated[float, msgspec.Meta(ge=0, le=LONGEST_WITHIN_S)] = 0.0
    later_s: Annotated[float, msgspec.Meta(ge=0, le=LONGEST_WITHIN_S)] = 0.0
    instead: str = ""
    asker: Annotated[str, msgspec.Meta(max_length=64)] = ""
    east_min: Annotated[int, msgspec.Meta(ge=-MOST_EAST_MIN, le=MOST_EAST_MIN)] | None = None
    careful: bool = False


class Cancel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """POST /cancel: this task, or with "" the oldest one that has not ended. `language`: of the
    answer.
    """

    task: str = ""
    language: Annotated[str, msgspec.Meta(pattern="^(en|pl)$")] = "en"


class InWords(msgspec.Struct, frozen=True):
    """The same in each language."""

    en: str
    pl: str


class TaskLine(msgspec.Struct, frozen=True, omit_defaults=True):
    """A task as hi knows it. `state`: a companion.languages.cmd.TaskState, or one of the words
    above.

    `then`: the tasks that follow, where a sentence has several wishes. `accepted`: the coordinator
    took it. `wish`: a sentence from which this task alone is understood. `replies`: sentences that
    answer a question. `steps`: what its plan does, one after the other; `before`: steps that its
    earlier plans did. `urgency`, `deadline`, `start` [unix s]: as it was said. `until`: when it is
    expected to be done [unix s], 0 where that is not known.

    `why`: reason of its state; `at`: where its plan is, or waits; `number`: of the step there, the
    first is 1, 0 for none of the steps. `asks`: the id of that place, if it waits for an operator.
    `text` is for a terminal: `why` and `at` in the operator's words, or hi's own words; no program
    reads it. `evidence`: at the end, what is true now and which senses told.
    """

    task: str
    state: str
    text: str
    said: str = ""
    since: float = 0.0
    then: tuple[str, ...] = ()
    accepted: bool = False
    wish: InWords | None = None
    replies: tuple[str, ...] = ()
    steps: tuple[Step, ...] = ()
    before: int = 0
    urgency: int = 0
    deadline: float = 0.0
    start: float = 0.0
    until: float = 0.0
    why: Facts = ()
    at: Place | None = None
    number: int = 0
    asks: str = ""
    evidence: tuple[Evidence, ...] = ()

    @property
    def asked(self) -> str:
        """The wish for a terminal. A person may have said a mere "yes", or several wishes."""
        return self.wish.en if self.wish else self.said or self.task


class Wish(msgspec.Struct, frozen=True):
    """A sentence that could be said now: what it does (a row of hi's catalogue), and with which
    thing, "" for none.
    """

    does: str
    thing: InWords
    says: InWords


class Question(msgspec.Struct, frozen=True):
    """A question of hi's: to whom, until when it can be answered [unix s], and by which sentences,
    in each language.
    """

    asker: str
    until: float
    replies: tuple[str, ...]


class Tasks(msgspec.Struct, frozen=True, omit_defaults=True):
    """GET /tasks: all tasks of this run, oldest first. `held`: the stop flag of hi's run folder is
    set.

    `wishes`: what could be done with the things that were seen, or talked of. `questions`: hi's
    open questions. `hands`: what each hand holds, None before hi was told.
    """

    tasks: tuple[TaskLine, ...]
    held: bool = False
    wishes: tuple[Wish, ...] = ()
    questions: tuple[Question, ...] = ()
    hands: dict[Side, str] | None = None

    def answers(self, asker: str, now: float) -> tuple[str, ...]:
        """The sentences that answer what was asked of somebody; none where nothing was, or it is
        too late.
        """
        open_ones = (one for one in self.questions if one.asker == asker and now < one.until)
        return next((one.replies for one in open_ones), ())


class HiEvent(msgspec.Struct, frozen=True, omit_defaults=True):
    """Something hi tells people; `n` counts from 1 without gaps. `t`: unix time [s]; `text`: as of
    a TaskLine.
    """

    n: int
    t: float
    agent: str
    name: str
    text: str
    task: str = ""


class Events(msgspec.Struct, frozen=True):
    """GET /events: events with n > since; `next` is what to ask with the next time."""

    next: int
    events: tuple[HiEvent, ...]


class Problem(msgspec.Struct, frozen=True):
    """Body of every answer that is not 200: what was wrong and what would have been right."""

    error: str
