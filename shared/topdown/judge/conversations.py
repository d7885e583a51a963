"""The conversations a judge follows: who is in them, what waits for an explanation, who waits for
an answer.
"""

import zlib
from collections import OrderedDict, defaultdict
from collections.abc import Hashable, Iterator
from enum import Enum, auto
from typing import Generic, NamedTuple, TypeVar

import msgspec

from fipa_codec import deadlines
from fipa_codec.communicate import Communicate, number_of
from fipa_codec.conversation import Needs, needs
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role
from topdown.judge.follow import Followed, TableMessage
from topdown.judge.verdicts import Heard, Verdict
from topdown.model import elements
from topdown.model.design import Design, Rule

ENDED_S = 60.0
"""An ended conversation is kept so long for its stragglers (estimate)."""
QUIET_S = 3600.0
"""One that neither ended nor may rest for ever is kept so long after its last word (estimate)."""
OVER = 20_000
"""Ended conversations whose names are remembered, so that a straggler is recognised (estimate)."""
ON_ITS_WAY_S = 0.25
"""A question that was heard so long after it was sent had a slow way; estimate: on one host it
takes milliseconds.
"""
SWEEP_S = 10.0
"""Seconds between two looks for conversations to forget (estimate: that is 1 us for each that is
open).
"""

Name = tuple[str, str, str, str]
"""m_c, protocol and the two agents, sorted: with several participants each has a conversation of
its own.
"""


class Entry(NamedTuple):
    """A communicate that the design knows. `doubtful`: something is wrong with it, so it may count
    for nothing.

    `faulty`: it was judged already, and not as legal.
    """

    heard: Heard
    communicate: Communicate
    rule: Rule
    kinds: tuple[Kind, ...]
    doubtful: bool = False
    faulty: bool = False


class Talk:
    """A conversation. `followed` None: nothing opened it yet.

    `lost`: why it is not judged ("": it is): a part of it was not heard. Its states are still
    followed, from anywhere.
    """

    def __init__(self, name: Name, at: float) -> None:
        self.name, self.at = name, at
        self.initiator = ""
        self.followed: Followed | None = None
        self.lost = ""
        self.pending: list[Entry] = []
        self.due: deadlines.Due = ()
        self.questions: dict[str, Entry] = {}
        """The last one that asked for each answer, by the answer's name in `due`."""
        self.withdrawn = False
        """Whether a cancel that is not answered yet was said by the reply-by of what it cancels."""
        self.opened: tuple[float, elements.Protocol] | None = None
        """When it was opened [s], and in which use; None once it was answered."""

    @property
    def agents(self) -> tuple[str, str]:
        """Both agents."""
        return self.name[2:]

    def role(self, agent: str) -> Role:
        """The role of one of them."""
        return Role.INITIATOR if agent == self.initiator else Role.PARTICIPANT

    def lose(self, why: str) -> list[Entry]:
        """Judge it no more; what waited in it."""
        left, self.pending, self.lost = self.pending, [], self.lost or why
        self.due = ()
        if self.followed is not None:
            self.followed.lose()
        return left

    def guess(self, entry: Entry) -> None:
        """It is lost, and this was said in it: where may both stand now?"""
        assert self.followed is not None
        self.followed.guess(self.role(entry.communicate.sender), self._at_a_guess(entry))

    def kept(self, now: float) -> bool:
        """Whether it is still to be kept at `now` [s]: none for ever, but one that may rest."""
        if self.followed is None or self.lost:
            return now < self.at + QUIET_S
        if any(side.may_rest for side in self.followed.sides.values()):
            return True
        return now < self.at + (ENDED_S if self.followed.ended else QUIET_S)

    def read(self, entry: Entry) -> TableMessage | str:
        """The communicate as the tables see it, or what is wrong with its labels."""
        assert self.followed is not None
        one = entry.communicate
        return self.followed.read(
            self.role(one.sender), one.performative, one.reply_with, one.in_reply_to, entry.kinds
        )

    def take(self, entry: Entry) -> str | deadlines.Word:
        """Follow it. What is wrong with it, in words; or, if it is in sequence, what it says."""
        assert self.followed is not None
        role, said = self.role(entry.communicate.sender), self.read(entry)
        if isinstance(said, str):
            return self._word(entry, self._at_a_guess(entry)) if entry.doubtful else said
        word = self._word(entry, said)
        if entry.doubtful:
            self.followed.doubt(role, said)
            return word
        side = self.followed.sides[role]
        wrong = self.followed.mislabelled(role, said.performative, entry.communicate.reply_with)
        if wrong:
            return wrong
        if self.followed.take(role, said):
            return word
        kinds = "|".join(kind for kind in said.kinds if kind)
        act = f"{said.performative}[{kinds}]" if kinds else str(said.performative)
        states = self.followed.states[0 if role is Role.INITIATOR else 1]
        who = f"{self.followed.protocol.name}: {role} {entry.communicate.sender}"
        return f"{who} says {act} in {states}; allowed: {side.may_say()}"

    def overlook(self, entry: Entry) -> None:
        """It was out of sequence: go on as if it had been said, or not."""
        assert self.followed is not None
        self.followed.doubt(self.role(entry.communicate.sender), self._at_a_guess(entry))

    def _at_a_guess(self, entry: Entry) -> TableMessage:
        """The communicate as the tables see it, or with any use that it may have if its labels tell
        none.
        """
        one, said = entry.communicate, self.read(entry)
        if isinstance(said, str):
            kinds = tuple(Kind) if one.performative is Performative.CONFIRM else entry.kinds
            return TableMessage(one.performative, kinds, one.reply_with)
        return said

    def _word(self, entry: Entry, said: TableMessage) -> deadlines.Word:
        """The message as the rule of deadlines sees it, before it is taken."""
        assert self.followed is not None
        protocol, one = self.followed.protocol, entry.communicate
        role, act = self.role(one.sender), one.performative
        again = self.followed.opened and needs(protocol, act) is Needs.SAME
        kinds = self.followed.sides[role].uses(said)
        return deadlines.Word(role, act, kinds, one.reply_with, one.in_reply_to, again)

    def timed(self, entry: Entry, word: deadlines.Word) -> tuple[Verdict, str]:
        """Whether it came in time, if it is an answer; what it asks for itself is noted."""
        assert self.followed is not None
        one, protocol = entry.communicate, self.followed.protocol
        at = one.sent or entry.heard.at
        found = deadlines.answered(self.due, protocol, word)
        verdict, why = self._speed(entry, word.role)
        if found is not None and at > found.by:
            verdict, why = Verdict.LATE, _how_late(at, found.by, self.questions[found.name])
        if word.performative is Performative.CANCEL:
            role = word.role.other.value
            self.withdrawn = any(one.name == role and at <= one.by for one in self.due)
        elif Kind.CANCEL in word.kinds:
            self.withdrawn = False
        self.due = deadlines.after(self.due, protocol, word, one.reply_by)
        known = self.questions
        if one.reply_by is not None:
            known = known | {deadlines.asked(protocol, word): entry}
        self.questions = {one.name: known[one.name] for one in self.due}
        return verdict, why

    def asks(self, entry: Entry) -> deadlines.Answer | None:
        """The answer that is due to this one."""
        return next((one for one in self.due if self.questions[one.name] is entry), None)

    def expire(self, entry: Entry) -> bool:
        """Whether an answer to this one was waited for in vain: none is taken back by a cancel in
        time, or owed by who has ended. Nobody waits for it any longer.
        """
        asks, asker = self.asks(entry), self.role(entry.communicate.sender)
        if asks is None or self.followed is None or self.followed.sides[asker.other].ended:
            return False
        if self.withdrawn and asks.name != deadlines.CANCEL:
            return False
        self.due = tuple(one for one in self.due if one != asks)
        return True

    def settle(self, asker: Role) -> None:
        """Nobody waits any longer for answers to what this role asked."""
        self.due = tuple(
            one
            for one in self.due
            if self.role(self.questions[one.name].communicate.sender) is not asker
        )

    def _speed(self, entry: Entry, role: Role) -> tuple[Verdict, str]:
        one = entry.communicate
        if self.opened is None or role is Role.INITIATOR:
            return Verdict.LEGAL, ""
        since, use = self.opened
        if use.answer and one.performative not in use.answer:
            return Verdict.LEGAL, ""
        self.opened = None
        took = entry.heard.at - since
        if took > use.latency_s > 0:
            why = (
                f"{1000 * took:.1f} ms after it was asked; {use.name} allows"
                f" {1000 * use.latency_s:g} ms"
            )
            return Verdict.SLOW, why
        return Verdict.LEGAL, ""


class Talks:
    """Conversations by name; those that ended are forgotten after a while."""

    def __init__(self, design: Design) -> None:
        self._tables = design.tables
        self._uses = {
            (use.initiator, use.participant, use.follows): use
            for use in (*design.file.protocol, *design.guest_uses.values())
        }
        self._open: dict[Name, Talk] = {}
        self._over = Remembered[bool](OVER)
        self._swept = float("-inf")

    def __iter__(self) -> Iterator[Talk]:
        return iter(tuple(self._open.values()))

    def __len__(self) -> int:
        return len(self._open)

    def find(self, one: Communicate) -> Talk | None:
        """The conversation of a communicate."""
        return self._open.get(name(one))

    def is_over(self, one: Communicate) -> bool:
        """Whether its conversation ended, and was forgotten."""
        return name(one) in self._over

    def begin(self, entry: Entry) -> Talk:
        """A conversation that is not open yet."""
        talk = self._open[name(entry.communicate)] = Talk(name(entry.communicate), entry.heard.at)
        return talk

    def opens(self, one: Communicate) -> bool:
        """Whether a communicate may open a conversation."""
        table = self._tables.get(one.protocol)
        use = self._uses.get((one.sender, one.receiver, one.protocol))
        return table is not None and use is not None and one.performative in table.openings

    def open(self, talk: Talk, entry: Entry) -> None:
        """It is opened by this communicate."""
        one = entry.communicate
        use = self._uses[one.sender, one.receiver, one.protocol]
        self._follow(talk, use)
        talk.opened = (entry.heard.at, use)

    def guess(self, talk: Talk, entry: Entry) -> None:
        """A communicate of a conversation of which a part was not heard, perhaps its opening."""
        one = entry.communicate
        if talk.followed is None:
            there, back = (
                (one.sender, one.receiver, one.protocol),
                (one.receiver, one.sender, one.protocol),
            )
            self._follow(talk, self._uses.get(there) or self._uses[back])
            assert talk.followed is not None
            talk.followed.lose()
        talk.guess(entry)

    def _follow(self, talk: Talk, use: elements.Protocol) -> None:
        talk.initiator = use.initiator
        talk.followed = Followed(self._tables[use.follows], durable=use.durable)

    def sweep(self, now: float) -> None:
        """It is `now` [s]: forget the conversations that are not to be kept, but for their
        names.
        """
        if abs(now - self._swept) < SWEEP_S:
            return
        self._swept = now
        for talk in self:
            if not talk.kept(now):
                del self._open[talk.name]
                self._over.note(talk.name, True)


def _how_late(at: float, until: float, question: Entry) -> str:
    """Why an answer sent at `at` is late; also if its question was long on its way."""
    asked = question.communicate
    words = f"{asked.performative} {asked.id}"
    way_s = question.heard.at - asked.sent if asked.sent else 0.0
    slow = (
        f"; {words} itself was heard {way_s:.3f} s after it was sent"
        if way_s > ON_ITS_WAY_S
        else ""
    )
    return f"{at - until:.3f} s after the reply-by of {words}{slow}"


def name(one: Communicate) -> Name:
    """The name of a conversation."""
    low, high = sorted((one.sender, one.receiver))
    return one.conversation, one.protocol, low, high


# --- Copies and numbers ---------------------------------------------------------------------------


T = TypeVar("T")
REMEMBERED = 20_000
"""Ids of one sender that are known again, 4 MB; estimate: minutes of an agent that says 40
communicates a second, whose outbox is smaller by far.
"""

Pair = tuple[str, str]
"""Sender and receiver."""


class Remembered(Generic[T]):
    """Values noted under some keys, the last `most` of them. Of a key only its hash is kept (64
    bits).
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._noted: OrderedDict[int, T] = OrderedDict()

    def note(self, key: Hashable, value: T) -> T | None:
        """The value noted under this key before; where there was none, note `value`."""
        name = hash(key)
        before = self._noted.get(name)
        if before is None:
            self._noted[name] = value
            if len(self._noted) > self._most:
                self._noted.popitem(last=False)
        return before

    def __contains__(self, key: Hashable) -> bool:
        return hash(key) in self._noted


class Known(Enum):
    """State of an id."""

    NEW = auto()
    SAME = auto()
    """The same words were said before."""
    OTHER = auto()
    """Other words bore this id."""


class Copies:
    """Ids that were heard, with what was said under them; of some nobody knows the content."""

    def __init__(self) -> None:
        self._prints: defaultdict[str, Remembered[tuple[int, int]]] = defaultdict(
            lambda: Remembered(REMEMBERED)
        )
        self._journals: defaultdict[str, int] = defaultdict(int)

    def note(self, heard: Heard, rule: Rule) -> Known:
        """What is known of this communicate's id, which is noted. A message without an id is always
        new.

        A latest value that is still due is said once more in a new conversation: only there it is a
        copy.
        """
        one = heard.communicate
        if one is None or not one.id:
            return Known.NEW
        words = 0 if one.content is msgspec.UNSET else zlib.crc32(one.content)
        found = hash((heard.key, one.conversation, one.reply_with, one.in_reply_to)), words
        receiver = (
            (one.receiver, self._journals[one.receiver])
            if one.receiver in self._journals
            else one.receiver
        )
        identity = (receiver, one.id, one.conversation if rule.latest else "")
        before = self._prints[one.sender].note(identity, found)
        if before is None:
            return Known.NEW
        same = before[0] == found[0] and (before[1] == words or 0 in (before[1], words))
        return Known.SAME if same else Known.OTHER

    def forget(self, agent: str) -> None:
        """The agent lost its journal: it numbers from 1 again, and so does who speaks to it."""
        self._prints.pop(agent, None)
        self._journals[agent] += 1


class Streams(Generic[T]):
    """Durable streams: what may be judged in order, and what waits for a smaller number."""

    def __init__(self) -> None:
        self._next: dict[Pair, int] = {}
        self._held: dict[Pair, dict[int, T]] = {}

    def put(self, pair: Pair, number: int, entry: T, *, first: int | None = None) -> list[T] | None:
        """What is in order now; nothing, while a smaller number is missing; None if older than the
        first heard.

        `first`: the number a stream begins with, where that is known.
        """
        expected = self._next.setdefault(pair, number if first is None else first)
        if number < expected:
            return None
        held = self._held.setdefault(pair, {})
        held[number] = entry
        return self._in_order(pair)

    def unheard(self, pair: Pair, label: str) -> bool:
        """Whether a label is a number of this stream (m_w of a durable message is its number) not
        heard so far.
        """
        number = number_of(label)
        return number is not None and number >= self._next.get(pair, 0)

    def give_up(self, pair: Pair, number: int) -> tuple[tuple[int, int], list[T]] | None:
        """The numbers missing before this one, first and last, and what is in order without them.

        None where it waits no longer.
        """
        if number not in self._held.get(pair, {}):
            return None
        missing = (self._next[pair], number - 1)
        before = [self._held[pair].pop(n) for n in sorted(self._held[pair]) if n < number]
        self._next[pair] = number
        return missing, [*before, *self._in_order(pair)]

    def forget(self, agent: str | None = None) -> list[T]:
        """Forget the streams of an agent, or all; what waited in them."""
        pairs = [pair for pair in self._next if agent is None or agent in pair]
        left: list[T] = []
        for pair in pairs:
            del self._next[pair]
            left += self._held.pop(pair, {}).values()
        return left

    def _in_order(self, pair: Pair) -> list[T]:
        held, ready = self._held[pair], []
        while self._next[pair] in held:
            ready.append(held.pop(self._next[pair]))
            self._next[pair] += 1
        return ready
