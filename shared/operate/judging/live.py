"""live.jsonl: a run in lines for a person's eyes while it goes on (docs/run-folder.md), made of records as they come.

Pure: a record in, lines out. Must not know: files, the terminal that shows them.
"""

from collections import Counter
from collections.abc import Iterator

import msgspec

from agent_runtime.core import unheard
from agent_runtime.core.unheard import Unheard
from companion.languages import hfsm, sw, wm
from companion.telemetry import RobotState
from companion.tools.report.events import events
from companion.tools.report.plans import states_of
from operate.recording.history import History
from operate.recording.records import House, Record, Spoken, Token
from operate.run_folder import Again, AgentIn, Happened, LiveLine, PlanAt, PlanSeen, Sent
from operate.wording import words
from topdown.judge.copies import Remembered

LOOP = "loop"
KNOWN = 50_000
"""Communicates whose copies are told as such, 10 MB (estimate)."""
STORY = 1000
"""From so many communicates events are told (C4's are not among them): three pours. Older ones are forgotten."""
_LATER = ("km hears of the first thing", "km knows the surroundings")
"""What can be said of the past only: the last observation before a plan."""


class _Beat(msgspec.Struct, frozen=True):
    """What is wanted of an agent's heartbeat."""

    agent: str
    state: str
    unheard: tuple[Unheard, ...] = ()


_beat = msgspec.json.Decoder(_Beat)
_robot = msgspec.msgpack.Decoder(RobotState)


class Live:
    """Remembers what is needed to tell what is new."""

    def __init__(self) -> None:
        self._known = Remembered[bool](KNOWN)
        self._states: dict[str, AgentIn] = {}
        self._story: list[Spoken] = []
        self._told: Counter[str] = Counter()
        self._not_heard: dict[str, tuple[Unheard, ...]] = {}

    def lines(self, record: Record) -> Iterator[LiveLine]:
        """The lines of a record; none for what repeats."""
        match record:
            case Spoken():
                if not record.id or not self._known.note(record.identity, True):
                    yield from self._spoken(record)
                else:
                    yield Again(t=record.received, sender=record.sender, receiver=record.receiver, id=record.id)
            case Token(agent=agent, alive=alive, received=t):
                state = self._states[agent].state if agent in self._states else ""
                born = record.incarnation if alive else 0
                yield from self._entered(AgentIn(t=t, agent=agent, state=state, alive=alive, incarnation=born))
            case House(kind="state" | "telemetry"):
                yield from self._house(record)

    def _spoken(self, one: Spoken) -> Iterator[LiveLine]:
        yield Sent(
            t=one.received,
            channel=one.channel,
            sender=one.sender,
            receiver=one.receiver,
            protocol=one.protocol,
            performative=one.performative,
            bytes=one.size,
            language=one.language,
            conversation=one.conversation,
            text=words(one.content),
            id=one.id,
            reply_with=one.communicate.reply_with,
            in_reply_to=one.communicate.in_reply_to,
            reply_by=one.communicate.reply_by,
            sent=one.sent,
            ontology=one.communicate.ontology,
            content="" if one.content is None else f"{one.language}.{type(one.content).__name__}",
            use=one.kind,
        )
        content = one.content
        if isinstance(content, hfsm.HierarchicalPlan) and one.channel == "C3":
            yield PlanSeen(t=one.received, plan=content.id, task=content.task, states=tuple(states_of(content.root)))
        elif isinstance(content, sw.Report):
            outcome = content.state.lower() if content.state in sw.FINAL else ""
            if content.at or outcome:
                yield PlanAt(t=one.received, at=content.at, outcome=outcome)
        if one.channel != "C4" and (one.channel != "C6" or isinstance(content, wm.SeenObject)):
            if len(self._story) >= STORY:
                self._story = self._story[-STORY // 2 :]
                self._told = Counter(event.name for event in events(History(said=tuple(self._story))))
            self._story.append(one)
            yield from self._news()

    def _news(self) -> Iterator[Happened]:
        """Events that were not told yet."""
        counted: Counter[str] = Counter()
        for event in events(History(said=tuple(self._story))):
            counted[event.name] += 1
            if counted[event.name] > self._told[event.name] and event.name not in _LATER:
                self._told[event.name] += 1
                yield Happened(t=event.at, name=event.name, text=event.text)

    def _house(self, house: House) -> Iterator[LiveLine]:
        try:
            if house.kind == "state":
                beat = _beat.decode(house.data)
                yield from self._entered(AgentIn(t=house.received, agent=beat.agent, state=beat.state))
                yield from self._unheard(beat, house.received)
                return
            robot = _robot.decode(house.data)
        except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
            return
        doing = robot.skill or robot.act if robot.mode in ("motion", "") else ""
        yield from self._entered(AgentIn(t=house.received, agent=LOOP, state=doing or robot.mode))

    def _unheard(self, beat: _Beat, t: float) -> Iterator[Happened]:
        """Who does not hear whom, once for each time."""
        before = self._not_heard.get(beat.agent, ())
        self._not_heard[beat.agent] = beat.unheard
        yield from (
            Happened(t=t, name="unheard", text=unheard.words(beat.agent, one, t))
            for one in beat.unheard
            if one not in before
        )

    def _entered(self, now: AgentIn) -> Iterator[AgentIn]:
        last = self._states.get(now.agent)
        if now.incarnation or last is None or (last.state, last.alive) != (now.state, now.alive):
            self._states[now.agent] = now
            yield now
