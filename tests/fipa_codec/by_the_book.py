"""How a line of by_the_book.txt is read: conversations written from the text of FIPA's
specifications.

`i.request/R1` the initiator says request with reply-with R1; `p.agree>R1` the participant says
agree in reply to R1; `p.inform[cancel]` answers a cancel that has no reply-with. The last message
of a line that begins with `!` is illegal, all others are legal. `a` or `b` before the protocol:
only our initiator, or only our participant, is tried, since the other side does what ours never
does (labels on every message). Request, query and subscribe are there in both profiles; `*` are
the lines in which they agree.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role


class Message(NamedTuple):
    """A message: who says it, the act, its reply-with and its in-reply-to; `kind`: what its sender
    means by it.
    """

    role: Role
    act: Performative
    label: str
    answers: str
    kind: Kind


class Line(NamedTuple):
    """A conversation. `ours`: the roles that are ours; `legal`: whether its last message is."""

    protocol: str
    ours: tuple[Role, ...]
    messages: tuple[Message, ...]
    legal: bool


ROLES = {"i": Role.INITIATOR, "p": Role.PARTICIPANT}
OURS = {"": tuple(Role), "a": (Role.INITIATOR,), "b": (Role.PARTICIPANT,)}


def line(text: str) -> Line:
    """Read a line."""
    head, _, rest = text.partition(": ")
    legal = not head.startswith("!")
    ours, _, protocol = head.lstrip("!").rpartition(" ")
    return Line(protocol, OURS[ours], tuple(message(word) for word in rest.split()), legal)


def message(word: str) -> Message:
    """Read a message."""
    said, _, answers = word.partition(">")
    said, _, label = said.partition("/")
    role, _, act = said.partition(".")
    act, _, kind = act.removesuffix("]").partition("[")
    return Message(ROLES[role], Performative(act), label, answers, Kind(kind))


def lines() -> Iterator[str]:
    """Each conversation of the book, a line; `*`: of the paper's protocol and of FIPA's."""
    for text in Path(__file__).with_suffix(".txt").read_text(encoding="utf-8").splitlines():
        if text and not text.startswith("#"):
            yield from (text.replace("*", name) for name in ("", "fipa-")[: 1 + ("*" in text)])


LINES = list(lines())
