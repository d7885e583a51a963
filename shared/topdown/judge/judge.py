"""The judge: hears every communicate that goes by, and says of each whether it is as designed, and
if not, why.

By the same tables, rules and languages as the agents run by. It takes part in nothing, may begin in
the middle, and hears things in an order that need not be the one in which they were said: a
communicate that nothing heard so far explains waits up to `patience_s` for one that does. Time
comes in as an argument; there is no I/O. A conversation whose beginning was not heard is not
judged, and never an alarm.
"""

import heapq
from collections.abc import Callable
from itertools import count

from fipa_codec.communicate import Communicate, decode_strictly, number_of
from fipa_codec.errors import MalformedError
from fipa_codec.languages import Languages
from fipa_codec.tables import Role
from topdown.judge.conversations import Copies, Entry, Known, Pair, Streams, Talk, Talks
from topdown.judge.verdicts import Admission, Heard, Judgement, Read, Verdict
from topdown.model.design import Design

# --- Calls due at given times. No clock: the caller passes the time -------------------------------


class Timers:
    """Calls, in the order of their times; of equal times in the order they were asked for."""

    def __init__(self) -> None:
        self._waiting: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = count()

    def later(self, at: float, then: Callable[[float], None]) -> None:
        """Have `then(at)` called once it is `at` [s]."""
        heapq.heappush(self._waiting, (at, next(self._order), then))

    def run(self, now: float) -> None:
        """It is `now` [s]: call what is due."""
        while self._waiting and self._waiting[0][0] <= now:
            at, _, then = heapq.heappop(self._waiting)
            then(at)


# --- The judge ------------------------------------------------------------------------------------


PATIENCE_S = 3.0
"""Longest wait of a communicate for its explanation [s]. Longer than the longest wait between two
sendings of a durable communicate (2 s, agent_runtime.core.streams), by which time a lost one was
heard.
"""
SETTLED_S = 0.25
"""At the end of a recording, what was heard so long before it waits for nothing more: on one host
the order differs by milliseconds (estimate).
"""


class Judge:
    """Judges the traffic of a design. Every communicate gets at least one judgement, perhaps later
    than it is heard.

    `languages` None: contents are not read. Times [s] of any one clock that does not go back;
    reply-by is compared with it.
    """

    def __init__(
        self, design: Design, languages: Languages | None = None, *, patience_s: float = PATIENCE_S
    ) -> None:
        self._admission, self._talks = Admission(design, languages), Talks(design)
        self._copies, self._streams = Copies(), Streams[Entry]()
        self._patience = patience_s
        self._numbers, self._timers = count(1), Timers()
        self._lives: dict[str, int] = {}
        self._journals: dict[str, str] = {}
        self._whole: set[str] = set()
        self._found: list[Judgement] = []

    # --- what comes in ----------------------------------------------------------------------------

    def hear(
        self,
        key: str,
        said: bytes | Communicate,
        at: float,
        size: int = 0,
        read: Read | None = None,
    ) -> tuple[Judgement, ...]:
        """A communicate went by on `key` at `at` [s]; `size` [bytes], where it is not given as
        bytes.

        `read`: LANGUAGE.Class ("" for none) and kind of the content, where that was read before or
        (None) nobody can read it. Judgements of it, and of earlier ones that it explains.
        """
        self._advance(at)
        if not isinstance(said, Communicate):
            size = size or len(said)
            try:
                said = decode_strictly(said)
            except MalformedError as error:
                return self._malformed(key, str(error), at, size)
        self._admit(Heard(next(self._numbers), at, key, size, said), said, read)
        return self._told()

    def noted(self, key: str, why: str, at: float) -> tuple[Judgement, ...]:
        """An agent noted that it got bytes that are not a communicate, and why; not the bytes
        themselves.
        """
        self._advance(at)
        return self._malformed(key, why, at, 0)

    def _malformed(self, key: str, why: str, at: float, size: int) -> tuple[Judgement, ...]:
        heard = Heard(next(self._numbers), at, key, size, None)
        self._say(Verdict.MALFORMED, heard, self._admission.channel(key), why)
        return self._told()

    def pass_time(self, now: float) -> tuple[Judgement, ...]:
        """It is `now` [s]: what waited in vain is judged."""
        self._advance(now)
        return self._told()

    def lived(
        self, agent: str, incarnation: int, at: float, *, fresh: bool = False, journal: str = ""
    ) -> tuple[Judgement, ...]:
        """An incarnation of an agent appeared. `fresh`: it was certainly not there before the judge
        listened.

        `journal`: the name of its journal; under another one its streams, and those to it, begin at
        1 again. Soft conversations (those no journal keeps) end with a life.
        """
        self._advance(at)
        before = self._lives.get(agent)
        self._lives[agent] = incarnation
        if before is None and fresh and incarnation == 1:
            self._whole.add(agent)
        another = self._journals.get(agent, journal) != journal
        self._journals[agent] = journal
        # its journal is lost: it numbers from 1 again
        if before is not None and (another or incarnation < before):
            self._copies.forget(agent)
            entries = self._streams.forget(agent)
            self._lose([talk for talk in self._talks if agent in talk.agents], entries)
        elif before is not None and incarnation > before:
            self._reborn(agent)
        return self._told()

    def finish(self, at: float) -> tuple[Judgement, ...]:
        """Nothing more will be heard after `at` [s]: what still waits is judged."""
        self._timers.run(at)
        self._timers.run(at - SETTLED_S + self._patience)
        self._lose([talk for talk in self._talks if talk.pending], self._streams.forget())
        return self._told()

    # --- one communicate --------------------------------------------------------------------------

    def _admit(self, heard: Heard, one: Communicate, read: Read | None) -> None:
        """By itself; as a copy; then in its place."""
        admitted = self._admission.check(heard.key, one, heard.size, read)
        rule = admitted.rule
        if rule is None:
            self._say(admitted.faults[0].verdict, heard, admitted.channel, admitted.faults[0].why)
            return
        known = self._copies.note(heard, rule)
        entry = Entry(heard, one, rule, admitted.kinds)
        if known is Known.SAME:
            self._again(entry)
            return
        for fault in admitted.faults:
            self._say(fault.verdict, heard, rule.channel, fault.why)
        if known is Known.OTHER:
            if not admitted.faults:
                why = f"{one.sender} said something else to {one.receiver} under the id {one.id!r}"
                self._say(Verdict.OUT_OF_SEQUENCE, heard, rule.channel, why)
            return
        doubtful = any(fault.verdict is not Verdict.OVER_BUDGET for fault in admitted.faults)
        entry = entry._replace(doubtful=doubtful, faulty=bool(admitted.faults))
        if rule.durable:
            self._number(entry)
        else:
            self._place(entry)

    def _again(self, entry: Entry) -> None:
        talk = self._talks.find(entry.communicate)
        if talk is not None and talk.followed is not None and not talk.lost:
            said = talk.read(entry)
            if not isinstance(said, str):
                talk.followed.repeat(talk.role(entry.communicate.sender), said)
        self._judge(Verdict.COPY, entry)

    def _number(self, entry: Entry) -> None:
        """In the order of its stream."""
        one = entry.communicate
        pair, number = (one.sender, one.receiver), number_of(one.id)
        if number is None:
            self._judge(
                Verdict.OUT_OF_SEQUENCE,
                entry,
                f"its id is {one.id!r}, not the number of a durable stream",
            )
            return
        first = 1 if one.sender in self._whole else None
        ready = self._streams.put(pair, number, entry, first=first)
        if ready is None:
            self._pass_over(entry, "said before anything of this stream was heard")
        elif not ready:
            self._timers.later(
                entry.heard.at + self._patience, lambda now: self._give_up(pair, number)
            )
        for each in ready or ():
            self._place(each)

    def _give_up(self, pair: Pair, number: int) -> None:
        """A number of a stream was not heard: what it said nobody knows."""
        found = self._streams.give_up(pair, number)
        if found is None:
            return
        (first, last), ready = found
        self._whole.difference_update(pair)
        numbers = str(first) if first == last else f"{first} to {last}"
        why = f"number {numbers} of {pair[0]} was not heard"
        between = [talk for talk in self._talks if set(talk.agents) == set(pair)]
        left = [entry for talk in between for entry in talk.lose(why)]
        for entry in sorted((*left, *ready), key=lambda one: one.heard.n):
            self._place(entry)

    def _place(self, entry: Entry) -> None:
        """In its conversation."""
        one = entry.communicate
        if not one.conversation:
            self._judge(
                Verdict.OUT_OF_SEQUENCE, entry, "it belongs to no conversation: it has no m_c"
            )
            return
        talk = self._talks.find(one)
        if talk is None and self._talks.is_over(one):
            self._judge(Verdict.NOT_JUDGED, entry, "its conversation ended long ago")
            return
        if talk is None:
            talk = self._talks.begin(entry)
        talk.at = entry.heard.at
        if talk.followed is None and not talk.lost and self._talks.opens(one):
            self._talks.open(talk, entry)
        if talk.lost:
            self._pass_over(entry, talk.lost)
        elif talk.followed is None or self._behind(talk, entry) or not self._took(talk, entry):
            talk.pending.append(entry)
            self._timers.later(
                entry.heard.at + self._patience, lambda now: self._expire(talk, entry)
            )
        else:
            self._retry(talk)

    def _behind(self, talk: Talk, entry: Entry) -> bool:
        """Whether something that the same agent said before still waits: a stream is in order."""
        sender = entry.communicate.sender
        return entry.rule.durable and any(one.communicate.sender == sender for one in talk.pending)

    def _took(self, talk: Talk, entry: Entry) -> bool:
        """Whether it is in sequence, by what was heard so far."""
        word = talk.take(entry)
        if isinstance(word, str):
            return False
        verdict, why = talk.timed(entry, word)
        asks = talk.asks(entry)
        if asks is not None:
            self._timers.later(asks.by + self._patience, lambda now: self._unanswered(talk, entry))
        if verdict is Verdict.LATE or not entry.faulty:
            self._judge(verdict, entry, why, talk)
        return True

    def _retry(self, talk: Talk) -> None:
        """Perhaps what waits is explained now."""
        going = bool(talk.pending)
        while going and talk.followed is not None:
            going = False
            waiting, talk.pending = talk.pending, []
            for entry in waiting:
                if self._behind(talk, entry) or not self._took(talk, entry):
                    talk.pending.append(entry)
                else:
                    going = True

    # --- what waited in vain ----------------------------------------------------------------------

    def _expire(self, talk: Talk, entry: Entry) -> None:
        if not any(one is entry for one in talk.pending):
            return
        one = entry.communicate
        before = next(other for other in talk.pending if other.communicate.sender == one.sender)
        # it waits for that one, which was heard later
        if entry.rule.durable and before is not entry:
            self._timers.later(
                before.heard.at + self._patience, lambda now: self._expire(talk, entry)
            )
            return
        if entry.rule.durable and self._streams.unheard(
            (one.receiver, one.sender), one.in_reply_to
        ):
            self._whole.difference_update(talk.agents)
            why = f"number {one.in_reply_to} of {one.receiver}, which it answers, was not heard"
            self._lose([talk], [], why)
            return
        if talk.followed is None:
            whole = self._whole.issuperset(talk.agents) and not entry.doubtful
            if whole:
                talk.pending = [one for one in talk.pending if one is not entry]
                why = f"nothing opened conversation {entry.communicate.conversation}"
                self._judge(Verdict.OUT_OF_SEQUENCE, entry, why)
            self._lose([talk], [], "the beginning of its conversation was not heard")
            return
        talk.pending = [one for one in talk.pending if one is not entry]
        # Never None here: what is explained was taken by the last retry.
        self._judge(Verdict.OUT_OF_SEQUENCE, entry, str(talk.take(entry)), talk)
        talk.overlook(entry)
        # an answer, if a wrong one: one fault, one verdict
        talk.settle(talk.role(one.sender).other)
        self._retry(talk)

    def _unanswered(self, talk: Talk, entry: Entry) -> None:
        if talk.expire(entry):
            why = f"{entry.communicate.receiver} had not answered when reply-by passed"
            self._say(Verdict.UNANSWERED, entry.heard, entry.rule.channel, why)

    def _lose(self, talks: list[Talk], entries: list[Entry], why: str = "") -> None:
        why = why or "a part of its conversation was not heard"
        left = [*entries, *(entry for talk in talks for entry in talk.lose(why))]
        for entry in sorted(left, key=lambda one: one.heard.n):
            self._pass_over(entry, why)

    def _pass_over(self, entry: Entry, why: str) -> None:
        """It is not judged; where its conversation may stand after it is followed all the same."""
        talk = self._talks.find(entry.communicate)
        if talk is not None:
            if not talk.lost:
                self._lose([talk], [], why)
            self._talks.guess(talk, entry)
        self._judge(Verdict.NOT_JUDGED, entry, why, talk)

    def _reborn(self, agent: str) -> None:
        for talk in self._talks:
            if agent in talk.agents and talk.followed is not None and not talk.followed.durable:
                talk.followed.sides[talk.role(agent)].forget()
                if agent == talk.initiator:
                    talk.settle(Role.INITIATOR)
                self._retry(talk)

    # --- verdicts and time ------------------------------------------------------------------------

    def _advance(self, now: float) -> None:
        """It is `now` [s]: what was to be done by then is done, what is over is forgotten."""
        self._timers.run(now)
        self._talks.sweep(now)

    def _judge(
        self, verdict: Verdict, entry: Entry, why: str = "", talk: Talk | None = None
    ) -> None:
        """Of one whose faults were told already only another violation is news."""
        judgement_states = (
            talk.followed.states if talk is not None and talk.followed is not None else ("", "")
        )
        found = Judgement(verdict, entry.heard, entry.rule.channel, why, judgement_states)
        if found.violation or not entry.faulty:
            self._found.append(found)

    def _say(self, verdict: Verdict, heard: Heard, channel: str, why: str) -> None:
        self._found.append(Judgement(verdict, heard, channel, why))

    def _told(self) -> tuple[Judgement, ...]:
        found, self._found = tuple(self._found), []
        return found
