"""The two ends of each message: what one agent says the other takes, per performative, protocol, language, ontology.

Compared are the messages of the protocols, the interfaces that agents declare (paper, section 4, step 4), and the
rows of their conversational behaviour.
"""

from collections.abc import Iterator
from typing import NamedTuple

from fipa_codec.performatives import Performative
from topdown import elements
from topdown.design import Design
from topdown.findings import Finding, Kind
from topdown.loading import Path_

ALWAYS = Performative.NOT_UNDERSTOOD
"""Goes both ways in every protocol and is not listed (SC00037J)."""


class Heard(NamedTuple):
    """A message with both of its ends."""

    use: elements.Protocol
    sender: str
    receiver: str
    message: elements.Message
    at: Path_

    @property
    def act(self) -> Performative:
        """What it does."""
        return self.message.performative

    def words(self, design: Design) -> dict[str, str]:
        """What a declared interface says of it, by the field of elements.Ends; what is undefined is left out."""
        use, found = self.use, {"performatives": str(self.act), "protocols": self.use.follows}
        if self.message.language in {entry.name for entry in design.file.language}:
            found["languages"] = self.message.language
        if use.ontology in {entry.name for entry in design.file.ontology}:
            found["ontologies"] = use.ontology
        return found


def messages(design: Design) -> Iterator[Heard]:
    """Every message that has two ends."""
    for index, use in enumerate(design.file.protocol):
        for number, message in enumerate(use.message):
            if message.sender in (use.initiator, use.participant):
                receiver = use.participant if message.sender == use.initiator else use.initiator
                at: Path_ = ("protocol", index, "message", number)
                yield Heard(use, message.sender, receiver, message, at)


def findings(design: Design) -> Iterator[Finding]:
    """Of declared interfaces, and of rows, where there are any."""
    heard = tuple(messages(design))
    said = {word for agent in design.file.agent for word in _said(agent)}
    spoken = {one.use.name for one in heard if one.sender == one.use.initiator and f"{one.use.name} {one.act}" in said}
    for index, agent in enumerate(design.file.agent):
        at: Path_ = ("agent", index)
        if agent.sends is not None:
            mine = [one for one in heard if one.sender == agent.name]
            yield from _declared(design, agent.name, "sends", agent.sends, mine, (*at, "sends"))
        if agent.receives is not None:
            mine = [one for one in heard if one.receiver == agent.name]
            yield from _declared(design, agent.name, "receives", agent.receives, mine, (*at, "receives"))
        if agent.row:
            yield from _rows(agent, heard, spoken, at)


def _declared(
    design: Design, agent: str, way: str, ends: elements.Ends, mine: list[Heard], at: Path_
) -> Iterator[Finding]:
    """Words of the declared interface without a message, and messages without their words."""
    lacking = Kind.RECEIVED_NOT_SENT if way == "sends" else Kind.SENT_NOT_RECEIVED
    idle = Kind.SENT_NOT_RECEIVED if way == "sends" else Kind.RECEIVED_NOT_SENT
    for field in elements.Ends.__struct_fields__:
        declared = [str(word) for word in getattr(ends, field)]
        used = {words[field]: one for one in mine if field in (words := one.words(design))}
        for word in sorted(used.keys() - set(declared)):
            one = used[word]
            where = f"protocol {one.use.name}, {one.sender} {one.act}"
            wrong = f"{agent} does not declare that it {way} {word}"
            yield Finding(lacking, where, wrong, f"its {way}.{field} are {', '.join(declared) or 'none'}", one.at)
        for word in declared:
            if word not in used and word != ALWAYS:
                right = f"they have {', '.join(sorted(used)) or 'none'}"
                wrong = f"declares that it {way} {word}, and no message does"
                yield Finding(idle, f"agent {agent}, {field}", wrong, right, at)


def _rows(agent: elements.Agent, heard: tuple[Heard, ...], spoken: set[str], at: Path_) -> Iterator[Finding]:
    """What an agent's rows say and take, against the messages that are listed; a message's `ruling` answers for it, and
    the `ruling` of a protocol for all of its messages where its initiator says none of them (not `spoken`).
    """
    says = _said(agent)
    takes = {_bare(row.on) for row in agent.row}
    out = {f"{one.use.name} {one.act}": one for one in heard if one.sender == agent.name}
    into = {f"{one.use.name} {one.act}": one for one in heard if one.receiver == agent.name}
    for word, one in out.items():
        if word not in says and not _ruled(one, spoken):
            yield _one_sided(Kind.RECEIVED_NOT_SENT, one, f"no row of {agent.name} says it")
    for word, one in into.items():
        if word not in takes and not _ruled(one, spoken):
            yield _one_sided(Kind.SENT_NOT_RECEIVED, one, f"no row of {agent.name} takes it")
    uses = {one.use.name for one in heard}
    for number, row in enumerate(agent.row):
        place, where = (*at, "row", number), f"agent {agent.name}, row {number + 1}"
        for word in (_bare(word) for word in (*row.say, *row.may)):
            if _open(word, uses) and word not in out:
                yield Finding(Kind.SENT_NOT_RECEIVED, where, f"says {word}, which no message lists", "list it", place)
        if _open(_bare(row.on), uses) and _bare(row.on) not in into:
            wrong = f"takes {_bare(row.on)}, which no message lists"
            yield Finding(Kind.RECEIVED_NOT_SENT, where, wrong, "list it", place)


def _said(agent: elements.Agent) -> set[str]:
    """`USE act` of everything an agent's rows say; an observation that is owed is an inform."""
    owed = {f"{use} {Performative.INFORM}" for row in agent.row for use in row.owes}
    return owed | {_bare(word) for row in agent.row for word in (*row.say, *row.may)}


def _ruled(one: Heard, spoken: set[str]) -> bool:
    """Whether a ruling says why a message has one end only."""
    return bool(one.message.ruling or (one.use.ruling and one.use.name not in spoken))


def _bare(word: str) -> str:
    """`act request` of `act request[kind]`."""
    return word.partition("[")[0]


def _open(word: str, uses: set[str]) -> bool:
    """Whether a word names an act in a use that the design has, one that must be listed."""
    use, _, act = word.partition(" ")
    return use in uses and act != ALWAYS


def _one_sided(kind: Kind, one: Heard, wrong: str) -> Finding:
    where = f"protocol {one.use.name}, {one.sender} {one.act}"
    return Finding(kind, where, wrong, "give it a row, or drop the message", one.at)
