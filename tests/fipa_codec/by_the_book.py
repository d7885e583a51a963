"""Conversations written from the text of FIPA's specifications, one a line, and how a line is read.

`i.request/R1` the initiator says request with reply-with R1; `p.agree>R1` the participant says
agree in reply to R1; `p.inform[cancel]` answers a cancel that has no reply-with. The last message
of a line that begins with `!` is illegal, all others are legal. `a` or `b` before the protocol:
only our initiator, or only our participant, is tried, since the other side does what ours never
does (labels on every message). Request, query and subscribe are there in both profiles; `both` are
the lines in which they agree.
"""

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


def both(page: str, protocol: str) -> str:
    """Return a page of the paper's protocol with the same lines of the book's."""
    return page + page.lstrip().replace(f"{protocol}: ", f"fipa-{protocol}: ")


REQUEST = """
request: i.request/R1 p.agree>R1 p.inform>R1
request: i.request/R1 p.agree>R1 p.failure>R1
request: i.request/R1 p.refuse>R1
request: i.request/R1 p.inform>R1
request: i.request/R1 p.failure>R1
request: i.request/R1 p.agree p.inform
request: i.request/R1 p.refuse
request: i.request/R1 p.not-understood>R1
request: i.request/R1 p.agree>R1 p.not-understood>R1
request: i.request/R1 p.agree>R1 i.not-understood
request: i.request/R1 i.cancel/R2 p.inform>R2
request: i.request/R1 i.cancel/R2 p.failure>R2
request: i.request/R1 i.cancel/R2 p.not-understood>R2
request: i.request/R1 i.cancel/R2 p.refuse>R1 p.failure>R2
request: i.request/R1 i.cancel/R2 p.inform>R1 p.failure>R2
request: i.request/R1 p.agree>R1 i.cancel/R2 p.inform>R2
request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2
request: i.request/R1 p.agree>R1 i.cancel/R2 p.inform>R1 p.failure>R2
request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R1 p.failure>R2
!request: p.agree
!request: p.inform
!request: i.inform
!request: i.agree
!request: i.query-ref/R1
!request: i.subscribe/R1
!request: i.request/R1 p.propose>R1
!request: i.request/R1 p.confirm>R1
!request: i.request/R1 p.inform-ref>R1
!request: i.request/R1 p.accept-proposal>R1
!request: i.request/R1 p.agree>R9
!request: i.request/R1 p.refuse>R9
!request: i.request/R1 p.agree>R1 p.agree>R1
!request: i.request/R1 p.agree>R1 p.refuse>R1
!request: i.request/R1 p.agree>R1 p.inform>R9
!request: i.request/R1 p.agree>R1 p.request/R1
!request: i.request/R1 i.inform
!request: i.request/R1 i.agree
!request: i.request/R1 i.confirm
!request: i.request/R1 p.agree>R1 i.inform
!request: i.request/R1 p.agree>R1 i.agree
!request: i.request/R1 p.cancel/C1
!request: i.request/R1 p.agree>R1 p.cancel/C1
b request: i.request/R1 i.cancel p.inform[cancel]
b request: i.request/R1 p.agree>R1 i.cancel p.failure[cancel]
b request: i.request/R1 p.agree>R1 i.cancel p.inform>R1 p.failure[cancel]
b request: i.request p.agree i.cancel p.inform[cancel]
!request: i.request/R1 p.agree>R1 i.cancel p.agree[cancel]
!request: i.request/R1 i.cancel/R2 i.cancel/R3
!request: i.request/R1 i.cancel/R2 p.inform>R9
!request: i.request/R1 i.cancel/R2 p.inform>R2 p.inform>R1
!request: i.request/R1 p.refuse>R1 p.inform>R1
!request: i.request/R1 p.failure>R1 p.inform>R1
!request: i.request/R1 p.inform>R1 p.inform>R1
!request: i.request/R1 p.inform>R1 p.failure>R1
"""
"""SC00026H."""

REQUEST_OF_THE_BOOK = """
fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1
fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.failure>R1
fipa-request: i.request/R1 i.cancel/R2 p.failure>R2 p.agree>R1 p.inform>R1
fipa-request: i.request/R1 i.cancel/R2 p.failure>R2 p.refuse>R1
fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.not-understood>R2 p.inform>R1
fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R3 p.inform>R3
b fipa-request: i.request/R1 p.agree>R1 i.cancel p.failure[cancel] p.inform>R1
b fipa-request: i.request/R1 p.agree>R1 i.cancel p.failure[cancel] i.cancel p.inform[cancel]
!b fipa-request: i.request/R1 p.agree>R1 i.cancel p.not-understood p.inform>R1
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.agree>R1
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1 p.inform>R1
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.failure>R2
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R2
fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R3 p.failure>R3 p.inform>R1
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R3 p.failure>R2
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R3 p.inform>R2
!fipa-request: i.request/R1 p.agree>R1 i.cancel/R2 p.not-understood>R2 i.cancel/R3 p.failure>R2
"""
"""SC00026H: a failed cancel leaves the request running."""

REQUEST_OF_THE_PAPER = """
!request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1
!request: i.request/R1 i.cancel/R2 p.failure>R2 p.agree>R1
!request: i.request/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R3
"""
"""A failed cancel ends the paper's request: docs/rulings.md."""

REQUEST_WHEN = """
request-when: i.request-when/R1 p.agree>R1 p.inform>R1
request-when: i.request-when/R1 p.agree>R1 p.failure>R1
request-when: i.request-when/R1 p.refuse>R1
request-when: i.request-when/R1 p.not-understood>R1
request-when: i.request-when/R1 p.agree>R1 i.cancel/R2 p.inform>R2
request-when: i.request-when/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1
request-when: i.request-when/R1 i.cancel/R2 p.inform>R2
!request-when: i.request/R1
!request-when: i.request-when/R1 p.inform>R1
!request-when: i.request-when/R1 p.failure>R1
!request-when: i.request-when/R1 p.agree>R1 p.refuse>R1
!request-when: i.request-when/R1 p.agree>R1 p.inform>R1 p.inform>R1
!request-when: i.request-when/R1 p.agree>R1 p.agree>R1
"""
"""SC00028H: the agreement is explicit, the act is done once."""

QUERY = """
query: i.query-ref/R1 p.inform>R1
query: i.query-if/R1 p.inform>R1
query: i.query-ref/R1 p.refuse>R1
query: i.query-if/R1 p.refuse>R1
query: i.query-ref/R1 p.failure>R1
query: i.query-if/R1 p.failure>R1
query: i.query-ref/R1 p.not-understood>R1
query: i.query-ref/R1 p.inform
!query: i.request/R1
!query: i.inform
!query: p.inform
!query: i.query-ref/R1 p.propose>R1
!query: i.query-ref/R1 p.confirm>R1
!query: i.query-ref/R1 p.inform>R9
!query: i.query-ref/R1 i.inform
!query: i.query-ref/R1 p.query-ref/R1
"""
"""SC00027H."""

QUERY_OF_THE_BOOK = """
fipa-query: i.query-ref/R1 p.agree>R1 p.inform>R1
fipa-query: i.query-if/R1 p.agree>R1 p.inform>R1
fipa-query: i.query-ref/R1 p.agree>R1 p.failure>R1
fipa-query: i.query-ref/R1 p.agree>R1 p.not-understood>R1
fipa-query: i.query-ref/R1 p.agree p.inform
fipa-query: i.query-ref/R1 i.cancel/R2 p.inform>R2
fipa-query: i.query-if/R1 p.agree>R1 i.cancel/R2 p.inform>R2
fipa-query: i.query-ref/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1
fipa-query: i.query-ref/R1 p.agree>R1 i.cancel/R2 p.inform>R1 p.failure>R2
fipa-query: i.query-ref/R1 i.cancel/R2 p.refuse>R1 p.failure>R2
!fipa-query: i.query-ref/R1 p.agree>R1 p.agree>R1
!fipa-query: i.query-ref/R1 p.agree>R1 p.refuse>R1
!fipa-query: i.query-ref/R1 p.inform-ref>R1
!fipa-query: i.query-if/R1 p.inform-if>R1
!fipa-query: i.query-ref/R1 p.inform>R1 p.inform>R1
!fipa-query: i.query-ref/R1 p.refuse>R1 p.inform>R1
!fipa-query: i.query-ref/R1 p.agree>R1 p.cancel/C1
b fipa-query: i.query-ref/R1 i.cancel p.inform[cancel]
!fipa-query: i.query-ref/R1 p.agree>R1 i.query-ref/R2
"""
"""SC00027H: agree and cancel; inform-ref is a macro act, which is not sent (SC00037J)."""

QUERY_OF_THE_PAPER = """
query: i.query-ref/R1 p.inform-ref>R1
!query: i.query-ref/R1 p.agree>R1
!query: i.query-ref/R1 i.cancel/R2
"""
"""Table 8: an immediate answer."""

CONTRACT_NET = """
cfp: i.cfp/R1 p.propose>R1 i.accept-proposal p.inform>R1
cfp: i.cfp/R1 p.propose>R1 i.accept-proposal p.failure>R1
cfp: i.cfp/R1 p.propose>R1 i.reject-proposal
cfp: i.cfp/R1 p.refuse>R1
cfp: i.cfp/R1 p.not-understood>R1
cfp: i.cfp/R1 p.propose i.accept-proposal p.inform
cfp: i.cfp/R1 p.propose>R1 i.not-understood
cfp: i.cfp/R1 i.cancel/R2 p.inform>R2
cfp: i.cfp/R1 p.propose>R1 i.cancel/R2 p.inform>R2
cfp: i.cfp/R1 p.propose>R1 i.accept-proposal i.cancel/R2 p.inform>R2
cfp: i.cfp/R1 p.propose>R1 i.accept-proposal i.cancel/R2 p.failure>R2 p.inform>R1
b cfp: i.cfp p.propose i.accept-proposal p.inform
b cfp: i.cfp/R1 p.propose>R1 i.accept-proposal/R2 p.inform>R2
b cfp: i.cfp/R1 p.propose>R1 i.accept-proposal/R2 p.inform>R1
b cfp: i.cfp/R1 p.propose>R1 i.accept-proposal/R2 p.failure>R2
b cfp: i.cfp/R1 p.propose>R1 i.reject-proposal/R2
b cfp: i.cfp/R1 p.propose>R1 i.accept-proposal/R2 i.cancel/R2 p.failure>R2 p.inform>R1
a cfp: i.cfp/R1 p.propose/P1>R1 i.accept-proposal>P1 p.inform>R1
a cfp: i.cfp/R1 p.propose/P1>R1 i.reject-proposal>P1
!cfp: i.propose
!cfp: p.propose
!cfp: i.accept-proposal
!cfp: i.request/R1
!cfp: i.cfp/R1 i.accept-proposal
!cfp: i.cfp/R1 i.reject-proposal
!cfp: i.cfp/R1 p.inform>R1
!cfp: i.cfp/R1 p.agree>R1
!cfp: i.cfp/R1 p.accept-proposal>R1
!cfp: i.cfp/R1 p.propose>R9
!cfp: i.cfp/R1 p.propose>R1 p.propose>R1
!cfp: i.cfp/R1 p.propose>R1 p.refuse>R1
!cfp: i.cfp/R1 p.propose>R1 p.inform>R1
!cfp: i.cfp/R1 p.propose>R1 p.accept-proposal>R1
!cfp: i.cfp/R1 p.propose>R1 i.inform
!cfp: i.cfp/R1 p.propose>R1 i.cfp/R2
!cfp: i.cfp/R1 p.propose>R1 i.accept-proposal i.reject-proposal
!cfp: i.cfp/R1 p.propose>R1 i.accept-proposal p.refuse>R1
!cfp: i.cfp/R1 p.propose>R1 i.accept-proposal p.inform>R9
!cfp: i.cfp/R1 p.propose>R1 i.accept-proposal p.inform>R1 p.inform>R1
!cfp: i.cfp/R1 p.propose>R1 i.reject-proposal p.inform>R1
!cfp: i.cfp/R1 p.refuse>R1 p.propose>R1
!cfp: i.cfp/R1 p.refuse>R1 i.accept-proposal
!cfp: i.cfp/R1 p.cancel/C1
b cfp: i.cfp/R1 i.cancel p.inform[cancel]
b cfp: i.cfp/R1 i.cancel p.failure[cancel] p.propose>R1 i.reject-proposal
"""
"""SC00029H; JADE's labels on accept-proposal."""

ITERATED = """
icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 p.propose>R2 i.accept-proposal p.inform>R2
icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 p.refuse>R2
icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 p.propose>R2 i.reject-proposal
icfp: i.cfp/R1 p.propose>R1 i.accept-proposal p.inform>R1
icfp: i.cfp/R1 p.propose>R1 i.reject-proposal
icfp: i.cfp/R1 p.refuse>R1
icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 i.cancel/R3 p.inform>R3
b icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 p.propose>R2 i.accept-proposal/R1 p.inform>R1
b icfp: i.cfp p.propose i.cfp p.propose i.accept-proposal p.inform
b icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 p.propose>R2 i.accept-proposal/R3 p.inform>R3
!icfp: i.cfp/R1 i.cfp/R2
!icfp: i.cfp/R1 p.propose>R1 i.cfp/R1
!icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 p.propose>R1
!icfp: i.cfp/R1 p.refuse>R1 i.cfp/R2
!icfp: i.cfp/R1 p.propose>R1 i.accept-proposal i.cfp/R2
!icfp: i.cfp/R1 p.propose>R1 i.reject-proposal i.cfp/R2
!icfp: i.cfp/R1 p.propose>R1 i.cfp/R2 i.accept-proposal
"""
"""SC00030H: a new round only to who proposed, none after an award."""

PROPOSE = """
propose: i.propose/R1 p.accept-proposal>R1
propose: i.propose/R1 p.reject-proposal>R1
propose: i.propose/R1 p.not-understood>R1
propose: i.propose/R1 i.cancel/R2 p.inform>R2
!propose: i.propose/R1 p.agree>R1
!propose: i.propose/R1 p.refuse>R1
!propose: i.propose/R1 i.inform
!propose: i.propose/R1 p.accept-proposal>R1 p.inform>R1
!propose: i.propose/R1 p.accept-proposal>R1 i.inform
!propose: i.propose/R1 p.accept-proposal>R1 p.reject-proposal>R1
!propose: i.propose/R1 p.accept-proposal>R9
!propose: i.cfp/R1
"""
"""SC00036H: the report on the act is not part of it."""

SUBSCRIBE = """
subscribe: i.subscribe/R1 p.agree>R1 p.inform>R1 p.inform>R1 p.inform>R1
subscribe: i.subscribe/R1 p.inform>R1 p.inform>R1
subscribe: i.subscribe/R1 p.refuse>R1
subscribe: i.subscribe/R1 p.agree>R1 p.failure>R1
subscribe: i.subscribe/R1 p.agree>R1 p.inform>R1 p.failure>R1
subscribe: i.subscribe/R1 p.failure>R1
subscribe: i.subscribe/R1 p.not-understood>R1
subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.inform>R2
subscribe: i.subscribe/R1 p.agree>R1 p.inform>R1 i.cancel/R2 p.inform>R2
subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.failure>R2
subscribe: i.subscribe/R1 i.cancel/R2 p.inform>R2
b subscribe: i.subscribe/R1 p.agree>R1 p.inform>R1 i.cancel/R1 p.inform>R1
b subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R1 p.failure>R1
a subscribe: i.subscribe/R1 p.agree>R1 p.inform/P1>R1 p.inform/P2>R1 i.cancel/R2 p.inform>R2
!subscribe: i.request/R1
!subscribe: p.inform
!subscribe: i.subscribe/R1 p.agree>R1 p.refuse>R1
!subscribe: i.subscribe/R1 p.refuse>R1 p.inform>R1
!subscribe: i.subscribe/R1 p.failure>R1 p.inform>R1
!subscribe: i.subscribe/R1 p.agree>R1 p.propose>R1
!subscribe: i.subscribe/R1 p.agree>R1 p.inform>R9
!subscribe: i.subscribe/R1 p.agree>R1 i.inform
!subscribe: i.subscribe/R1 p.cancel/C1
b subscribe: i.subscribe/R1 p.agree>R1 i.cancel p.inform[cancel]
!subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.inform>R2 p.inform>R1
!subscribe: i.subscribe/R1 p.agree>R1 i.subscribe/R2
"""
"""SC00035H; JADE's cancel carries the subscription's label."""

SUBSCRIBE_OF_THE_BOOK = """
fipa-subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1
fipa-subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.failure>R2 i.cancel/R3 p.inform>R3
b fipa-subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R1 p.failure>R1 p.inform>R1 i.cancel/R1 p.inform>R1
fipa-subscribe: i.subscribe/R1 i.cancel/R2 p.failure>R2 p.agree>R1 p.inform>R1
fipa-subscribe: i.subscribe/R1 p.agree>R1 p.inform>R1 i.cancel/R2 p.not-understood>R2 p.inform>R1
!fipa-subscribe: i.subscribe/R1 p.inform>R1 p.agree>R1
!fipa-subscribe: i.subscribe/R1 p.agree>R1 p.agree>R1
!fipa-subscribe: i.subscribe/R1 p.inform>R1 p.refuse>R1
!fipa-subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.refuse>R1
"""  # noqa: E501
"""SC00035H: a failed cancel leaves the subscription running; no agree after the first
notification.
"""

SUBSCRIBE_OF_THE_PAPER = """
!subscribe: i.subscribe/R1 p.agree>R1 i.cancel/R2 p.failure>R2 p.inform>R1
"""
"""A failed cancel ends the paper's subscription: docs/rulings.md."""

PROXY = """
brokering: i.proxy/R1 p.refuse>R1
brokering: i.proxy/R1 p.agree>R1 p.failure>R1
brokering: i.proxy/R1 p.not-understood>R1
recruiting: i.proxy/R1 p.refuse>R1
recruiting: i.proxy/R1 p.agree>R1 p.failure>R1
recruiting: i.proxy/R1 p.agree>R1 p.inform>R1
!brokering: i.request/R1
!brokering: i.proxy/R1 p.propose>R1
!brokering: i.proxy/R1 p.agree>R1 p.refuse>R1
!brokering: i.proxy/R1 p.refuse>R1 p.inform>R1
!recruiting: i.proxy/R1 p.inform>R1
!recruiting: i.proxy/R1 p.agree>R1 p.agree>R1
"""
"""SC00033H and SC00034H."""

BOTH = (both(REQUEST, "request"), both(QUERY, "query"), both(SUBSCRIBE, "subscribe"))
OF_THE_BOOK = (REQUEST_OF_THE_BOOK, QUERY_OF_THE_BOOK, SUBSCRIBE_OF_THE_BOOK)
OF_THE_PAPER = (REQUEST_OF_THE_PAPER, QUERY_OF_THE_PAPER, SUBSCRIBE_OF_THE_PAPER)
BOOK = (*BOTH, *OF_THE_BOOK, *OF_THE_PAPER, REQUEST_WHEN, CONTRACT_NET, ITERATED, PROPOSE, PROXY)
LINES = [text for page in BOOK for text in page.strip().splitlines()]
