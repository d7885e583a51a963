"""The two ends of each message: what one agent says the other takes, per performative, protocol, language, ontology.

Compared are the messages of the protocols and the interfaces that agents declare (paper, section 4, step 4); rows.py
compares the messages with what agents do.
"""

from collections.abc import Iterator
from typing import NamedTuple

from fipa_codec.performatives import Performative
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_

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
        """Return the kind of its act in words."""
        return self.message.performative

    def words(self, design: Design) -> dict[str, str]:
        """Return the words of a declared interface, by the field of elements.Ends; undefined ones are left out."""
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
    """Of declared interfaces, where there are any."""
    heard = tuple(messages(design))
    for index, agent in enumerate(design.file.agent):
        at: Path_ = ("agent", index)
        if agent.sends is not None:
            mine = [one for one in heard if one.sender == agent.name]
            yield from _declared(design, agent.name, "sends", agent.sends, mine, (*at, "sends"))
        if agent.receives is not None:
            mine = [one for one in heard if one.receiver == agent.name]
            yield from _declared(design, agent.name, "receives", agent.receives, mine, (*at, "receives"))


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
