"""Lines of this robot in live.jsonl: plans, where ta is in them, events, and what the loop does."""

from collections import Counter
from collections.abc import Iterator

import msgspec

from companion.languages import hfsm, sw, wm
from companion.telemetry import RobotState
from companion.tools.report.events import Kind, events
from companion.tools.system import LOOP
from fipa_codec.communicate import UNREADABLE
from operate.live_lines import AgentIn, Happened, LiveLine, PlanAt, PlanSeen, Step, Task
from operate.recording.history import History
from operate.recording.records import House, Record, Spoken

STORY = 1000
"""Communicates that events are told from (C4's are not among them): three pours. Older ones are
forgotten.
"""
_LEFT_OUT = (Kind.FIRST_THING, Kind.SURROUNDINGS, Kind.PLAN_BEGINS)
"""Events that are known only afterwards (the last observation before a plan), or come with another
one.
"""
_AGAIN = (Kind.PLAN_RECEIVED, Kind.FINISHED, Kind.REFUSED, Kind.ENDED)
"""Events that lines of plans and tasks tell, too."""
_robot = msgspec.msgpack.Decoder(RobotState)


class Live:
    """The lines of a run of the Robot Companion, beside those of any system."""

    def __init__(self) -> None:
        self._story: list[Spoken] = []
        self._tasks: dict[str, tuple[Task, ...]] = {}
        self._told: Counter[str] = Counter()

    def lines(self, record: Record) -> Iterator[LiveLine]:
        """The lines of a record; of communicates each is given once."""
        if isinstance(record, Spoken):
            yield from self._spoken(record)
        elif isinstance(record, House) and record.kind == "telemetry":
            yield from self._loop(record)

    def _spoken(self, one: Spoken) -> Iterator[LiveLine]:
        content = one.content
        if isinstance(content, hfsm.HierarchicalPlan) and one.channel == "C3":
            tasks = self._tasks.pop(one.conversation, ())
            yield PlanSeen(
                t=one.received, plan=content.id, tasks=tasks, states=tuple(states_of(content.root))
            )
        elif isinstance(content, hfsm.GroundTaskNetwork):
            tasks = tuple(Task(task.name, task.arguments) for task in content.tasks)
            self._tasks[one.conversation] = tasks
        elif isinstance(content, sw.Report):
            outcome = content.state.lower() if content.state in sw.FINAL else ""
            if content.at or outcome:
                at = content.at
                place = None if at is None else _step(at.path, at.step, at.act)
                yield PlanAt(t=one.received, at=place, outcome=outcome)
        if one.channel != "C4" and (one.channel != "C6" or isinstance(content, wm.SeenObject)):
            if len(self._story) >= STORY:
                self._story = self._story[-STORY // 2 :]
                self._told = Counter(
                    event.name for event in events(History(said=tuple(self._story)))
                )
            self._story.append(one)
            counted: Counter[str] = Counter()
            for event in events(History(said=tuple(self._story))):
                counted[event.name] += 1
                if counted[event.name] > self._told[event.name] and event.kind not in _LEFT_OUT:
                    self._told[event.name] += 1
                    again = event.kind in _AGAIN
                    yield Happened(
                        t=event.at, name=event.kind, of=event.of, text=event.text, again=again
                    )

    def _loop(self, house: House) -> Iterator[AgentIn]:
        try:
            robot = _robot.decode(house.data)
        except UNREADABLE:
            return
        doing = robot.skill or robot.act if robot.mode in ("motion", "") else ""
        yield AgentIn(t=house.received, agent=LOOP, state=doing or robot.mode)


def states_of(machine: hfsm.Machine, path: tuple[str, ...] = ()) -> Iterator[Step]:
    """All states of a plan, in the order of its tree."""
    for state in machine.states:
        here = (*path, state.name)
        match state:
            case hfsm.Machine():
                yield _step(here, state.step)
                yield from states_of(state, here)
            case hfsm.ActState(command=command):
                yield _step(here, machine.step, type(command).__name__)
            case hfsm.EndState():
                yield _step(here, None)
            case _:
                yield _step(here, hfsm.step_of(state) or machine.step)


def _step(path: tuple[str, ...], step: hfsm.Step | None, act: str = "") -> Step:
    if step is None:
        return Step(path, act=act)
    return Step(path, step.does, step.things, step.side or "", act)
