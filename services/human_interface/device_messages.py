"""Messages between hi and its devices. None is a communicate, none leaves the computer."""

import msgspec

from companion.design import AnyCommand
from companion.languages.values import Side
from companion.run_files import HiEvent, Question, TaskLine, Wish

# --- The meaning of a sentence --------------------------------------------------------------------


class NamedObject(msgspec.Struct, frozen=True, omit_defaults=True):
    """A thing as it was named. `kinds`: what the word can mean, none for an unknown word; `number`:
    jar 2.

    `quality`: a colour, a size or a place beside the name. `ref`: it, this, other or both, in place
    of a name. `doubt`: why the name may mean something else: it is plural, or of a similar thing.
    """

    said: str
    kinds: tuple[str, ...] = ()
    number: int = 0
    quality: str = ""
    ref: str = ""
    doubt: str = ""


class Clause(msgspec.Struct, frozen=True, omit_defaults=True):
    """One wish or question: a row of the catalogue, and what was named in it, in the order of the
    words.

    `lacks`: something that the wish needs was left out. `unsure`: it was said with something that
    cannot be done so; the sentence of hi's catalogue that says what.
    """

    does: str
    things: tuple[NamedObject, ...] = ()
    side: str = ""
    task: str = ""
    lacks: bool = False
    unsure: str = ""


class Mention(msgspec.Struct, frozen=True, omit_defaults=True):
    """A thing within a sentence. `role`: by the word before it: "to", "from", "beside" or ""."""

    thing: NamedObject
    role: str = ""


class Part(msgspec.Struct, frozen=True, omit_defaults=True):
    """A part of a sentence that is not understood as a whole: the wishes for tasks, the row for a
    question or an answer (`talk`), and the sentence of what the robot cannot do, at which its words
    hint; and the things in it. Words of what it cannot do that stand first leave no wish.
    """

    does: tuple[str, ...] = ()
    mentions: tuple[Mention, ...] = ()
    talk: str = ""
    cannot: str = ""


class Hints(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a sentence may be about. `parts`: those that hint at wishes for tasks, or say where
    something is to go; `talk`, `cannot`: as of a Part; `named`: the things in other parts; `asks`:
    it begins as a question about one; `side`: of a hand.
    """

    parts: tuple[Part, ...] = ()
    talk: str = ""
    cannot: str = ""
    named: tuple[Mention, ...] = ()
    asks: bool = False
    side: str = ""


class When(msgspec.Struct, frozen=True, omit_defaults=True):
    """Times at which the wishes of a sentence are wanted. `urgent`: before all else; `within_s`:
    seconds until they are done, `later_s`: until they may begin.

    `by`, `at`: the same as times of day in minutes; three o'clock is two of them, by night and by
    day.
    """

    urgent: bool = False
    within_s: float = 0.0
    by: tuple[int, ...] = ()
    later_s: float = 0.0
    at: tuple[int, ...] = ()


class Meaning(msgspec.Struct, frozen=True, omit_defaults=True):
    """A sentence: its clauses in order, none where it is not understood, and then why, in the
    catalogue's terms.

    `when` they are wanted. `guessed`: words were taken for others that are written alike.
    `partly`: only parts of the sentence were read. `strange`: the first word that nobody knows.
    `near`: the wish whose example is most like it. `hints`: what it may be about,
    where it is not understood without doubt.
    """

    language: str = "en"
    clauses: tuple[Clause, ...] = ()
    guessed: bool = False
    partly: bool = False
    why: str = ""
    strange: str = ""
    near: str = ""
    when: When = When()
    hints: Hints = Hints()


class _Message(msgspec.Struct, frozen=True, tag=True):
    """A message between the agent and its HTTP device."""


class Sentence(_Message, frozen=True, omit_defaults=True, tag="Said"):  # step logs have this word
    """A person said a sentence, which was read already; the answer goes to `ticket`. `held`: the
    robot is stopped.

    `urgency`, `within_s`, `later_s`: of the tasks that it becomes, 0 for none; `instead`: a task
    that they replace. `asker`: who said it, `at`: when [unix s]; `east_min`: how far the asker's
    clock is ahead of UTC [min], if known. `careful`: ask before what cannot be undone.
    """

    ticket: str
    text: str
    meaning: Meaning = Meaning()
    held: bool = False
    urgency: int = 0
    within_s: float = 0.0
    later_s: float = 0.0
    instead: str = ""
    asker: str = ""
    at: float = 0.0
    east_min: int | None = None
    careful: bool = False


class CancelWanted(_Message, frozen=True, omit_defaults=True):
    """A person cancels a task, "" for the oldest open one; the answer is in `language`."""

    ticket: str
    task: str = ""
    language: str = "en"


class Wanted(_Message, frozen=True):
    """A guest of the design wants a task; the answer goes to `ticket`. `held`: the robot is
    stopped; `at`: when it was asked for [unix s].
    """

    ticket: str
    guest: str
    task: AnyCommand
    held: bool
    at: float


class Halted(_Message, frozen=True):
    """A person stopped the robot (`held`) or let it go; it has been done already, where it could be
    (`reached`).
    """

    held: bool
    reached: bool
    text: str


class StopRobot(_Message, frozen=True):
    """Stop the robot: what a person said meant that after all. The answer goes to `ticket`."""

    ticket: str
    text: str


class Answer(_Message, frozen=True):
    """To the person who holds the ticket: a line on a task, or `problem` with the HTTP status."""

    ticket: str
    line: TaskLine | None = None
    problem: str = ""
    status: int = 200


class NewEvent(_Message, frozen=True, tag="Told"):  # step logs have this word
    """An event for /events."""

    event: HiEvent


class Shown(_Message, frozen=True):
    """All tasks as they are now, for /tasks, what could be said and is asked, what the hands hold,
    and what was seen (None before the first look around); `events`: how many were told so far.
    """

    tasks: tuple[TaskLine, ...]
    events: int
    wishes: tuple[Wish, ...] = ()
    questions: tuple[Question, ...] = ()
    hands: dict[Side, str] | None = None
    seen: tuple[str, ...] | None = None


Local = Sentence | Wanted | CancelWanted | Halted
"""Messages that the devices post: people's by HTTP, guests' at their door."""
