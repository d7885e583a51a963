"""Conversations from the text of FIPA's specifications: both sides of ours, and a judge beside
them, say the same.
"""

from by_the_book import LINES, Line, Message, line
from rows import each_row

from fipa_codec.communicate import Communicate
from fipa_codec.conversation import Conversation
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind
from fipa_codec.protocols import named
from fipa_codec.tables import Role
from topdown.judge.follow import Followed

AGENTS = {Role.INITIATOR: "ina", Role.PARTICIPANT: "pit"}
REQUIRED = 150


class Play:
    """A line: our sides of it, where they are ours, and a judge who hears everything; `lenient`:
    one to whom it is volatile, so that what is lost may be said and answered again.
    """

    def __init__(self, played: Line) -> None:
        self.protocol, self.ours = named(played.protocol), played.ours
        self.judge, self.lenient = (
            Followed(self.protocol, durable=True),
            Followed(self.protocol, durable=False),
        )
        self.sides = {
            role: Conversation.open(
                self.protocol, role, id="C1", me=AGENTS[role], peer=AGENTS[role.other]
            )
            for role in played.ours
        }

    def on_the_wire(self, said: Message) -> Communicate:
        return Communicate(
            performative=said.act,
            protocol=self.protocol.name,
            reply_with=said.label,
            in_reply_to=said.answers,
            conversation="C1",
            sender=AGENTS[said.role],
            receiver=AGENTS[said.role.other],
        )

    def verdicts(self, said: Message) -> set[bool]:
        """Whether it is legal, as each of our sides and the judge say; who takes it goes on."""
        found = {judged(self.judge, said)}
        if said.role in self.sides:
            found.add(self._sent(said))
        if said.role.other in self.sides:
            found.add(self._received(said))
        return found

    def _kind(self, said: Message) -> Kind:
        """Of an answer: that of the cancel where its label says so, as agents that know what they
        answer say it.
        """
        side = self.sides.get(said.role)
        cancelled = side is not None and said.answers != "" and said.answers == side.cancel
        return Kind.CANCEL if cancelled else said.kind

    def _sent(self, said: Message) -> bool:
        side, label = self.sides[said.role], said.label or "X1"
        words = {"in_reply_to": said.answers, "kind": self._kind(said)}
        try:
            after, message = side.send(said.act, id=label, now=1.0, **words)
        except FipaError:
            return False
        assert not said.label or message.reply_with == said.label
        self.sides[said.role] = after
        return True

    def _received(self, said: Message) -> bool:
        side = self.sides[said.role.other]
        try:
            self.sides[said.role.other] = side.receive(self.on_the_wire(said))
        except FipaError:
            return False
        return True


def judged(judge: Followed, said: Message) -> bool:
    """Whether a judge finds it in sequence; then it goes on."""
    if judge.mislabelled(said.role, said.act, said.label):
        return False
    read = judge.read(said.role, said.act, said.label, said.answers, (Kind.PLAIN,))
    return not isinstance(read, str) and judge.take(said.role, read)


def test_every_conversation_of_the_book() -> None:
    """Every message but an illegal last one is legal; all who look at it agree. There are enough,
    and none twice.
    """

    def agreed(text: str) -> None:
        played = line(text)
        play = Play(played)
        *before, last = played.messages
        for said in before:
            assert play.verdicts(said) == {True}, said
            assert judged(play.lenient, said), said
        assert play.verdicts(last) == {played.legal}
        assert judged(play.lenient, last) or not played.legal

    each_row(((text,) for text in LINES), agreed)
    assert len(set(LINES)) == len(LINES) >= REQUIRED
