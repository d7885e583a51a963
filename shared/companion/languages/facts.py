"""Facts say why, what and how much in the content languages: a kind with its things, hand, numbers
and words.

Programs decide by kinds and parts. Sentences are made where a person reads them
(companion.sentences). Here are the kinds that several tasks share; a kind of one task is in its
room (companion.tasks, part `done`).
"""

import re
from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Self

import msgspec
from msgspec.structs import replace

from companion.languages.evidence import Of, member
from companion.languages.values import Side


class AnyKind(StrEnum):
    """What a fact says: a general kind, or one of a task. Behind each kind stand its parts, in the
    order of a sentence: `a`, `b` for things, `things` for any number of them, `side` for a hand,
    `x:m` for a number with its unit, `w:part` for a word of a list, `because` for facts that are
    the reason. `asks`: its sentence asks a person to do something.
    """

    parts: tuple[str, ...]
    asks: bool

    def __new__(cls, value: str, parts: str = "", asks: bool = False) -> Self:
        """The kind with its parts."""
        kind = str.__new__(cls, value)
        kind._value_, kind.parts, kind.asks = value, tuple(parts.split()), asks
        return kind


class Kind(AnyKind):
    """The general kinds."""

    # What is seen
    SEEN = "seen", "things"
    SEEN_NOTHING = "seen-nothing"
    NOT_SEEN = "not-seen", "a"
    NOT_SEEN_SINCE = "not-seen-since", "a", True  # it is not where it was
    LOST_SINCE = "lost-since", "side a", True  # a hand lost it, and it was not seen since
    GIVEN_AWAY = "given-away", "side a"  # to a person, and it was not seen since
    NOT_WHERE_IT_WAS = "not-where-it-was", "a because"
    FELL_OVER = "fell-over", "a"
    LIES = "lies", "a"
    UPSIDE_DOWN = "upside-down", "a"
    ON_THE_FLOOR = "on-the-floor", "a", True
    PERSON_NEEDED = "person-needed", "because", True
    ASIDE = "aside", "a x:m"  # from where it was put down
    MOVED = "moved", "a x:m"
    ABOVE = "above", "a b"
    OUT_OF_VIEW = "out-of-view", "a"
    NOT_LOOKED_AROUND = "not-looked-around", "because"
    NO_LOOK_IN_A_PLAN = "no-look-in-a-plan"
    # Senses
    NOT_CHECKED = "not-checked", "w:claim a", True
    ILL = "ill", "w:sensor v:fault x:rad"
    NOTHING_IS_SEEN = "nothing-is-seen"
    NOT_BEGUN = "not-begun", "because"
    BODY_OFF = "body-off", "x:rad"  # torso or head are elsewhere than measured, by more than this
    ARM_OFF = "arm-off", "side x:m"
    UNCHECKABLE = "uncheckable", "side"  # neither the camera nor the wrist can check an act
    # Hands
    HOLDS = "holds", "side a"
    HOLDS_NOT = "holds-not", "side a"
    NO_HAND_HOLDS = "no-hand-holds", "a"
    HANDS_EMPTY = "hands-empty"
    HANDS_FULL = "hands-full", "", True  # and nobody named the thing
    OTHER_HAND_WANTED = "other-hand-wanted", "side"
    PUT_DOWN_FIRST = "put-down-first", "side a"
    STILL_HELD = "still-held", "things because"
    HOLDING = "holding", "things"
    FEELS_NOT = "feels-not", "side a"
    LOST = "lost", "side a"
    FEELS_LITTLE = "feels-little", "side x:kg"
    SLIPS = "slips", "side x:kg"
    WRIST_DOUBTED = "wrist-doubted", "side a"  # it alone tells that the hand is empty
    TOUCHED = "touched", "side a x:fingers"
    # Where things stand
    INSIDE_ANOTHER = "inside-another", "a"
    STANDS_FREE = "stands-free", "a"
    SEEN_WHERE_IT_STANDS = "seen-where-it-stands", "a"
    PUT_DOWN_UNSEEN = "put-down-unseen", "a"
    DID_NOT_FALL = "did-not-fall", "a"
    STANDS_ELSEWHERE = "stands-elsewhere", "a"
    SOMETHING_ON_A_TABLE = "something-on-a-table"
    NOTHING_ON_A_TABLE = "nothing-on-a-table"
    STAYS = "stays", "a because"
    ARMS_HOME = "arms-home"
    NOTHING_BESIDE = "nothing-beside", "a"
    FEWER_BESIDE = "fewer-beside", "a x:things"
    FEWER_DOORS = "fewer-doors", "x:doors"
    NOT_IN_THE_WAY = "not-in-the-way"
    HANGS_ON_A_HINGE = "hangs-on-a-hinge", "a"
    FIRST_PLACE_UNKNOWN = "first-place-unknown", "a"
    NO_ROOM = "no-room", "a b"
    # Ways of the arms
    UNREACHED = "unreached", "side a"
    NO_GRASP = "no-grasp", "side a because"
    NO_WAY_TO = "no-way-to", "side a"
    NO_WAY_CARRYING = "no-way-carrying", "side a"
    NO_PLACE_WITHIN_REACH = "no-place-within-reach", "side a"
    NO_WAY_TO_PUT_DOWN = "no-way-to-put-down", "side a"
    NO_WAY_INTO = "no-way-into", "side a b"
    NO_PLACE_REACHED_IN = "no-place-reached-in", "side a b"
    NO_WAY_HOME = "no-way-home", "side"
    NOT_ABOVE_ITS_PLACE = "not-above-its-place", "side"
    NO_PATH_TO_ITS_PLACE = "no-path-to-its-place", "side"
    NO_FREE_PLACE = "no-free-place", "side a"
    WAY_NOT_FREE = "way-not-free", "w:body v:body"
    WAY_BLOCKED = "way-blocked"
    NOT_STRAIGHT = "not-straight", "side because"
    MET_SOMETHING = "met-something", "side a x:m"  # above the place of the thing
    NO_OPENING = "no-opening", "a"
    NO_KNOWN_GRASP = "no-known-grasp", "a"
    # of a straight way of the hand: by reach, jump or collision
    LINE_ENDS = "line-ends", "x:percent w:limit"
    # The body
    NOT_FOLLOWED = "not-followed", "w:part x:rad"
    FINGER_NOT_FOLLOWED = "finger-not-followed", "side x:number y:rad"
    HAND_OFF = "hand-off", "side x:m y:rad"
    BESIDE_ITS_PATH = "beside-its-path", "side x:m"
    NOT_ARRIVED = "not-arrived", "w:part x:s"
    MOTION_REFUSED = "motion-refused", "w:field"
    FAULT = "fault", "", True  # of the control loop, which says it in its log
    HELD_STILL = "held-still", "w:mode"
    # Processes and messages
    BAD_COMMAND = "bad-command", "w:field"
    BEGUN_BEFORE = "begun-before"
    BUSY = "busy", "w:agent"
    TASKS_OPEN = "tasks-open", "x:tasks", True
    ENDED = "ended", "w:process"
    GAVE_NO_ANSWER = "gave-no-answer", "w:process"
    NO_MOTION_FOUND = "no-motion-found", "x:s"
    NEW_WORLD = "new-world"
    BROKE_OFF = "broke-off", "w:agent"
    NOT_ANSWERED = "not-answered", "w:agent"
    NOT_UNDERSTOOD = "not-understood", "w:agent"
    NO_REASON = "no-reason", "w:agent"
    TOOK_TOO_LONG = "took-too-long", "w:agent"
    NOT_ANSWERING = "not-answering", "w:agent"
    SAY_AGAIN_LATER = "say-again-later", "because", True
    NOT_OBSERVED_YET = "not-observed-yet"  # observations are under way to km
    CANCELLED = "cancelled"
    OBSERVER_AWAY = "observer-away"
    LOOK_NOT_OVER = "look-not-over"
    STATES_LOST = "states-lost"
    # Plans
    PLAN = "plan", "x:number because"
    PLAN_TAKES = "plan-takes", "x:number y:s"
    TOOK = "took", "x:s"
    GIVEN_UP = "given-up", "x:plans because"
    NO_METHOD = "no-method"
    NOT_A_TASK = "not-a-task", "w:task"
    NOT_A_HAND = "not-a-hand", "w:hand"
    NOT_A_PLACE = "not-a-place", "w:furniture"
    SEARCH_TOO_LONG = "search-too-long", "x:steps", True
    LOCALIZED = "localized", "a"
    NOT_LOCALIZED = "not-localized", "a"
    SO_ALREADY = "so-already"
    LOOKS_FIRST = "looks-first"
    NEW_PLAN_WANTED = "new-plan-wanted"
    OPERATOR_WANTS_A_PLAN = "operator-wants-a-plan"
    NOBODY_CAME = "nobody-came", "x:min"
    UNKNOWN_TO_KM = "unknown-to-km", "w:asked"
    WRONG_PLAN = "wrong-plan"

    # Scheduling
    ONLY_ONE = "only-one"
    COSTS_LEAST = "costs-least"
    SWITCH_COSTS = "switch-costs", "x:s y:s"  # to switch, to wait
    WAIT_COSTS = "wait-costs", "x:s y:s"  # to wait, to switch
    NO_EARLIER_DEADLINE = "no-earlier-deadline"
    CAME_FIRST = "came-first"
    EARLIEST_DEADLINE = "earliest-deadline", "x:s"
    RUNS_ALREADY = "runs-already"
    NOTHING_ELSE_WAITS = "nothing-else-waits"
    THE_REST_FOLLOWS = "the-rest-follows"
    LESS_URGENT = "less-urgent"
    MORE_URGENT = "more-urgent"
    BEGINS_IN = "begins-in", "x:s"
    IS_NEXT = "is-next"
    TASKS_BEFORE = "tasks-before", "x:tasks because"
    COMES_BEFORE = "comes-before", "w:task things because"
    UNDER_WAY = "under-way"
    DUE_EARLIER = "due-earlier"
    SAID_BEFORE = "said-before"
    COSTS_LESS = "costs-less"
    LEFT_FOR = "left-for", "w:task things because"
    GOES_ON = "goes-on", "w:task things because"
    PUT_ASIDE = "put-aside"
    NOT_BEGUN_YET = "not-begun-yet"
    WHILE_PLANNED = "while-planned"


if TYPE_CHECKING:
    KindOfFact = AnyKind
else:
    # msgspec takes one enumeration for a field, and there is one more for each task
    KindOfFact = str


class Fact(msgspec.Struct, frozen=True, omit_defaults=True):
    """A fact of a kind, with the parts that its kind names. `numbers`: in the units that it names.

    Raises ValueError for a kind that neither the general ones nor those of a task have.
    """

    kind: KindOfFact
    things: tuple[Of, ...] = ()
    side: Side | None = None
    numbers: tuple[float, ...] = ()
    words: tuple[Of, ...] = ()
    because: tuple["Fact", ...] = ()

    def __post_init__(self) -> None:
        """Replace the name of a kind, as it is read, by the kind."""
        if type(self.kind) is str:
            msgspec.structs.force_setattr(self, "kind", member(AnyKind, self.kind))


Facts = tuple[Fact, ...]


def fact(kind: AnyKind, *parts: Any) -> Fact:
    """A fact from the parts of its kind, in their order. Raises ValueError for others.

    Parts are str, Side, float and, as reasons, Fact or Facts.
    """
    left = list(parts)
    names = ("things", "side", "numbers", "words", "because")
    found: dict[str, list[Any]] = {name: [] for name in names}
    for name in kind.parts:
        field = _FIELDS[name.partition(":")[0]]
        if name == "because":
            reasons = [
                one for part in left for one in (part if isinstance(part, tuple) else (part,))
            ]
            found[field] = [one for one in reasons if isinstance(one, Fact)]
            left = [one for one in reasons if not isinstance(one, Fact)]
        elif name == "things":
            while left and isinstance(left[0], str):
                found[field].append(left.pop(0))
        elif left:
            found[field].append(left.pop(0))
        else:
            raise ValueError(f"{kind} needs {' '.join(kind.parts)}, got {parts}")
    if left:
        raise ValueError(f"{kind} takes {' '.join(kind.parts) or 'no parts'}, got {parts}")
    return Fact(
        kind,
        tuple(map(_name, found["things"])),
        Side(found["side"][0]) if found["side"] else None,
        # a sentence has no more digits
        tuple(float(f"{number:.4g}") for number in found["numbers"]),
        tuple(map(_name, found["words"])),
        tuple(found["because"]),
    )


_FIELDS = {"a": "things", "b": "things", "things": "things", "side": "side", "x": "numbers",
           "y": "numbers",
           "w": "words", "v": "words", "because": "because"}  # fmt: skip
_BECAUSE_BYTES = len(msgspec.msgpack.encode("because")) + 3
"""Of the name and the length of reasons."""


def _name(word: object) -> str:
    """A word as it can be read (Of): a person may have used other letters, and blanks."""
    return re.sub(r"[^!-~]", "_", str(word))[:64]


def with_reasons(facts: Facts) -> Iterator[Fact]:
    """Yield facts, each with its reasons behind it, however deep."""
    for one in facts:
        yield one
        yield from with_reasons(one.because)


def fitting(facts: Facts, room: int) -> Facts:
    """The first facts, as many as fit into so many bytes; the last one with as many of its
    reasons.
    """
    told: list[Fact] = []
    for one in facts:
        if (left := room - len(msgspec.msgpack.encode(one))) < 0:
            bare = replace(one, because=())
            if (left := room - len(msgspec.msgpack.encode(bare)) - _BECAUSE_BYTES) >= 0:
                told.append(replace(one, because=fitting(one.because, left)))
            break
        told.append(one)
        room = left
    return tuple(told)


def different(facts: Facts) -> Facts:
    """The facts, each of them once."""
    return tuple(dict.fromkeys(facts))
