"""The sentences that a person may say, as a small grammar; from sentence to command of language CMD.

    pour    = "pour" ["out"] [["the"] ("content" | "contents") "of"] thing ("into" | "in" | "to") thing
    take    = ("take" | "grab" | "get" | "grasp" | "bring" | "fetch" | "pick up") ["out"] ["me"] thing ["out"] [hand]
              | "pick" thing "up" [hand]
    hand    = ("with" | "in" | "using") ["the" | "your"] ("left" | "right") ["hand" | "arm"]
    putdown = ("put" | "set") ("down" thing | thing "down") [table] | ("put" | "set") thing table
    table   = ("on" | "onto") ["the"] "table"
    look    = "look" ["around"]
    cancel  = ("cancel" | "stop") [task]
    status  = "status"
    thing   = ["the" | "a" | "an" | "this" | "that" | "my"] word {word}          (no word of the grammar, no pronoun)

Case, punctuation and polite words do not matter. Anything else is answered with the sentences that are understood and
the most similar one. Must not know: HTTP, the coordinator, which things there are (km knows).
"""

import difflib
import re

import msgspec

from companion.languages import cmd

LONGEST_SENTENCE = 500  # characters; estimate: nobody speaks longer
NEAR = 0.75  # similarity from which another verb may be a typing error; "dance" has 0.73 to "cancel" (measured)
LONGEST_THING = 30  # characters: two of them fit the 250 bytes of a request on C2


class CancelTask(msgspec.Struct, frozen=True):
    """Cancel a task; "" is the oldest one that has not ended."""

    task: str = ""


class TellStatus(msgspec.Struct, frozen=True):
    """Tell the status."""


class NotUnderstood(msgspec.Struct, frozen=True):
    """A polite refusal: what is understood, and the most similar sentence."""

    text: str


Wish = cmd.PourInto | cmd.Take | cmd.PutDown | cmd.LookAround | CancelTask | TellStatus

EXAMPLES = (
    "pour the content of the jar into the bowl",
    "pour the jar into the bowl",
    "take the jar",
    "take the jar with the left hand",
    "put down the jar",
    "put the jar down",
    "look around",
    "cancel",
    "status",
)
UNDERSTOOD = "pour the X into the Y; take the X [with the left|right hand]; put down the X; look around; cancel; status"

_POLITE = re.compile(
    r"\b(?:please|kindly|thanks|thank you|hello|hi|hey|dear|robot|velma"
    r"|(?:can|could|will|would) you|i (?:want|would like|need) you to|be so kind (?:and|as to)|for me)(?![\w-])"
)
_NOISE = re.compile(r"[^\w\s-]|_")
_ARTICLE = r"(?:(?:the|a|an|this|that|my) )?"
_HAND = r"(?: (?:with|in|using) (?:(?:the|your) )?(?P<side>left|right)(?: (?:hand|arm))?)?"
_TAKE = r"(?:take|grab|get|grasp|bring|fetch|pick up)(?: out)?(?: me)?"


def _thing(name: str) -> str:
    return rf"{_ARTICLE}(?P<{name}>.+?)"


_CONTENT = r"(?:(?:the )?contents? of )?"
_POUR = re.compile(rf"pour(?: out)? {_CONTENT}{_thing('source')} (?:into|in|to) {_thing('destination')}")
_TABLE = r"(?: (?:on|onto) (?:the )?table)"
_TAKES = (re.compile(rf"{_TAKE} {_thing('object')}(?: out)?{_HAND}"), re.compile(rf"pick {_thing('object')} up{_HAND}"))
_PUTS = (
    re.compile(rf"(?:put|set) down {_thing('object')}{_TABLE}?"),
    re.compile(rf"(?:put|set) {_thing('object')} down{_TABLE}?"),
    re.compile(rf"(?:put|set) {_thing('object')}{_TABLE}"),
)
_NAMELESS = re.compile(r"out|the|a|an|this|that|my|it|me|you|them|him|her|something|anything|everything")
_OF_GRAMMAR = re.compile(
    r"\b(?:the|it|me|and|or|then|with|using|in|into|on|onto|to|of|from|down|up|pour|take|grab|put|cancel|stop)\b"
)
_LOOK = re.compile(r"look(?: around)?")
_CANCEL = re.compile(r"(?:cancel|stop)(?: (?P<task>hi-\d+-\d+))?(?: (?:it|that|this|the task))?")
_STATUS = re.compile(r"status")


def understand(sentence: str) -> Wish | NotUnderstood:
    """Return the wish of a sentence, or a refusal; never raises."""
    if len(sentence) > LONGEST_SENTENCE:
        return NotUnderstood(f"That is longer than {LONGEST_SENTENCE} characters. I understand: {UNDERSTOOD}.")
    words = plain(sentence)
    wish = _pour(words) or _take(words) or _put_down(words) or _of_robot(words)
    return wish or _refusal(words)


def plain(sentence: str) -> str:
    """Return the sentence in small letters, without punctuation and polite words, with single blanks."""
    bare = " ".join(_NOISE.sub(" ", sentence.lower()).split())
    return " ".join(_POLITE.sub(" ", bare).split())


def in_words(wish: Wish) -> str:
    """Return a sentence from which `understand` gets the same wish."""
    match wish:
        case cmd.PourInto(source=source, destination=destination):
            return f"pour the content of the {source} into the {destination}"
        case cmd.Take(object=thing, side=""):
            return f"take the {thing}"
        case cmd.Take(object=thing, side=side):
            return f"take the {thing} with the {side} hand"
        case cmd.PutDown(object=thing):
            return f"put down the {thing}"
        case cmd.LookAround():
            return "look around"
        case CancelTask(task=task):
            return f"cancel {task}".strip()
        case TellStatus():
            return "status"


def _pour(words: str) -> cmd.PourInto | NotUnderstood | None:
    found = _POUR.fullmatch(words)
    if found is None:
        return None
    source, destination = found["source"], found["destination"]
    if source == destination:
        return NotUnderstood(f"I cannot pour the {source} into itself. Into what else shall I pour it?")
    return _unfit(source, destination) or cmd.PourInto(source, destination)


def _take(words: str) -> cmd.Take | NotUnderstood | None:
    found = _first(_TAKES, words)
    return found and (_unfit(found["object"]) or cmd.Take(found["object"], found["side"] or ""))


def _put_down(words: str) -> cmd.PutDown | NotUnderstood | None:
    found = _first(_PUTS, words)
    return found and (_unfit(found["object"]) or cmd.PutDown(found["object"]))


def _of_robot(words: str) -> Wish | None:
    """Return a wish that names no thing."""
    if _LOOK.fullmatch(words):
        return cmd.LookAround()
    if (found := _CANCEL.fullmatch(words)) is not None:
        return CancelTask(found["task"] or "")
    return TellStatus() if _STATUS.fullmatch(words) else None


def _first(patterns: tuple[re.Pattern[str], ...], words: str) -> re.Match[str] | None:
    return next((found for pattern in patterns if (found := pattern.fullmatch(words)) is not None), None)


def _unfit(*things: str) -> NotUnderstood | None:
    """Return a refusal if a word cannot be the name of a thing."""
    for thing in things:
        if len(thing.encode()) > LONGEST_THING:
            return NotUnderstood(f"{thing!r} is too long for the name of a thing.")
        if _NAMELESS.fullmatch(thing):
            return NotUnderstood(f"I do not know what {thing!r} is. Please name the thing.")
        if _OF_GRAMMAR.search(thing):
            return NotUnderstood(f"I take {thing!r} for no thing. One wish at a time, please: {UNDERSTOOD}.")
    return None


def _refusal(words: str) -> NotUnderstood:
    verb = words.partition(" ")[0]
    same = [example for example in EXAMPLES if example.partition(" ")[0] == verb]
    near = difflib.get_close_matches(words, same, n=1, cutoff=0.0) if same else []
    near = near or difflib.get_close_matches(words, EXAMPLES, n=1, cutoff=NEAR)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    return NotUnderstood(f"I am sorry, I do not understand that.{hint} I understand: {UNDERSTOOD}.")
