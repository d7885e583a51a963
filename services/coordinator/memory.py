"""Memory of co between two steps: tasks in the order in which they are done, conversations that
outlive their task.

The first job is planned and run, the others wait; while it runs, pl is asked for their schedule
parameters. Must not know: messages, clocks.
"""

from collections.abc import Callable, Iterator
from enum import StrEnum

import msgspec
from msgspec.structs import replace

from companion.design import AnyCommand
from companion.languages import hfsm
from companion.languages.cmd import Command
from companion.languages.facts import Fact, Facts, Kind, fact
from companion.languages.values import Side


class Limits(msgspec.Struct, frozen=True):
    """Waiting times of co in seconds of wall time, and its largest number of tasks. Simulated
    seconds count as wall time: at speed "max" they are shorter.
    """

    # reply-by of a request for a plan: 6 s, over 60 s at a load of 17 (measured)
    planning_s: float = 180.0
    cancel_planning_s: float = 10.0  # pl forwards only, so a cancel is taken at once (estimate)
    # two things put down and two arms home take 60 s, tried twice (measured)
    cancel_acting_s: float = 240.0
    patience_s: float = 60.0  # how long tasks go on waiting when pl or ta is late (estimate)
    replans: int = 6  # new plans of one task before it is given up (estimate)
    # requests while the robot looks around; km holds each for 5 s, so 10 min (estimate)
    looks: int = 120
    # open tasks: an agree and two last messages each stay below the outbox bound if hi is dead
    waiting: int = 5
    # of each act: ta's margin of 10 s, and what lies between acts: 7 s at a load of 24 (measured)
    act_s: float = 20.0
    # of each question to km; estimate: milliseconds, and a second at such a load
    ask_s: float = 5.0
    # 20 s until a stopped act has ended, 30 s until km has what was seen (services.task)
    end_s: float = 50.0

    def acting_s(self, plan: hfsm.HierarchicalPlan) -> float:
        """The reply-by of a plan [s from now]: five times its planned duration, and
        what ta allows besides.

        Longer than what ta gives all its acts together, so that on a busy machine ta, which asks
        for a new plan then, gives a late act up before the task fails here; who is dead or hangs,
        others see in seconds.
        """
        leaves = [*_leaves(plan.root)]
        kinds = (hfsm.ActState, hfsm.AskState)
        acts, asks = (sum(isinstance(one, kind) for one in leaves) for kind in kinds)
        return 5.0 * plan.duration + acts * self.act_s + asks * self.ask_s + self.end_s


def _leaves(machine: hfsm.Machine) -> Iterator[hfsm.State]:
    """Yield the leaves of a plan, of its ways to safety, too."""
    for state in (*machine.states, *((machine.safe,) if machine.safe is not None else ())):
        yield from _leaves(state) if isinstance(state, hfsm.Machine) else (state,)


class Stage(StrEnum):
    """The stage of a task. `early`: its time to start has not come."""

    EARLY = "early"
    WAITING = "waiting"
    PLANNING = "planning"
    PLANNED = "planned"
    RUNNING = "running"


class Choice(StrEnum):
    """The decision of state `schedule`."""

    OPEN = "open"
    CONTINUE = "continue"
    SWITCH = "switch"


class Job(msgspec.Struct, frozen=True, omit_defaults=True):
    """co's record of a task of hi."""

    conversation: str  # hi's, and the task's name
    command: AnyCommand
    arrived: float  # unix time [s]
    stage: Stage = Stage.WAITING
    # the conversation with pl (PLANNING; WAITING: about its schedule parameters) or ta (RUNNING)
    talk: str = ""
    # the plan
    plans: int = 0  # number requested
    looks: int = 0  # how often the plan had to wait for a look around
    plan: hfsm.HierarchicalPlan | None = None
    # the task for pl since a first plan settled which object and hand the sentence means
    meant: hfsm.Task | None = None
    # what hi was told last: the place in the plan, and the reason (or why the next plan is wanted)
    at: hfsm.Place | None = None
    why: Facts = ()
    hands: dict[Side, str] | None = None  # what each hand holds, as ta told last; None: not yet
    # cancelled, or left for another one
    cancelling: bool = False
    suspending: bool = False  # ta was asked to leave it for another one
    suspended: int = 0  # how often that was done
    aside: bool = False  # it waits for its turn since
    # scheduling
    schedule: tuple[hfsm.ScheduleParameters, ...] = ()  # of its newest plan, () while unknown
    holds: int = 0  # number of hands that are full when it is done
    asked: bool = False  # pl was asked for the parameters since the world changed
    recalled: bool = False  # that question was called off
    weighed: bool = False  # a decision was made with the parameters
    # running
    patience_s: float = 0.0  # how long ta may take for the plan that runs
    asks: bool = False  # that plan waits for an operator

    @property
    def begun(self) -> bool:
        """Whether it is under way: planned, or asked to be, since it came or was put aside."""
        under_way = self.stage not in (Stage.WAITING, Stage.EARLY)
        return not self.aside and (under_way or self.plans > 0 or self.looks > 0)

    @property
    def waits(self) -> bool:
        """Whether it waits for its turn, and may be weighed against the one that runs."""
        return self.stage is Stage.WAITING and not self.cancelling

    @property
    def leavable(self) -> bool:
        """Whether it may be left for another one: it runs or could, and nobody has asked ta to
        leave it.
        """
        return self.stage in (Stage.PLANNED, Stage.RUNNING) and not (
            self.cancelling or self.suspending
        )

    @property
    def may_hold(self) -> bool:
        """Whether a plan of it ended with the wish for a new one: what that has taken is still in a
        hand.
        """
        return self.plans - self.suspended > 1

    @property
    def left_with_plan(self) -> bool:
        """Whether ta gets a plan only to leave it safely: it was cancelled while that was made, and
        may hold things.
        """
        return self.cancelling and self.may_hold and self.stage in (Stage.PLANNING, Stage.PLANNED)

    @property
    def parameters(self) -> hfsm.ScheduleParameters | None:
        """Its schedule parameters now, of the plan's state that hi was told last. None while they
        are unknown.
        """
        number = self.number(self.at)
        return self.schedule[number - 1] if number else next(iter(self.schedule), None)

    def number(self, at: hfsm.Place | None) -> int:
        """The number of the plan's step at a place, from 1; 0 where it is none of its steps."""
        place = at.path[0] if at is not None else None
        steps = (number for number, one in enumerate(self.schedule, start=1) if one.at == place)
        return next(steps, 0)


class Decision(msgspec.Struct, frozen=True, omit_defaults=True):
    """The task that goes on, and whether the running one is left for it; `rival`: the other one,
    where there were two.

    `switch_cost`, `wait_cost`: where they were compared.
    """

    task: str
    why: Fact
    switch: bool = False
    switch_cost: float = 0.0
    wait_cost: float = 0.0
    rival: str = ""


def about(kind: Kind, job: Job, *why: Fact) -> Fact:
    """A fact about the task of a job, with its name and arguments."""
    task = job.command.task
    return fact(kind, task.name, *filter(None, task.arguments), *why)


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`arrived`: commands that are not queued yet; `over`: a task has just ended; `loose`:
    conversations with pl or ta whose reply-by has passed (hi was told) and whose last message is
    still to come; `decision`: the last one.
    """

    arrived: tuple[Job, ...] = ()
    jobs: tuple[Job, ...] = ()
    choice: Choice = Choice.OPEN
    over: bool = False
    loose: tuple[str, ...] = ()
    decision: Decision | None = None

    @property
    def first(self) -> Job | None:
        """The task that is worked on or comes next."""
        return self.jobs[0] if self.jobs else None

    def of_hi(self, conversation: str) -> Job | None:
        """The task of a conversation with hi."""
        return next((job for job in self.jobs if job.conversation == conversation), None)

    def of_talk(self, conversation: str) -> Job | None:
        """The task of a conversation with pl or ta."""
        return next((job for job in self.jobs if job.talk == conversation), None)

    def with_job(self, job: Job) -> "Memory":
        """The memory with this task updated."""
        jobs = tuple(job if one.conversation == job.conversation else one for one in self.jobs)
        return replace(self, jobs=jobs)

    def without_job(self, job: Job) -> "Memory":
        """The memory without a task that has ended."""
        jobs = tuple(one for one in self.jobs if one.conversation != job.conversation)
        return replace(self, jobs=jobs, over=True, choice=Choice.OPEN).changed()

    def changed(self) -> "Memory":
        """The memory after the world may have changed: schedule parameters are to be asked for
        again.
        """
        jobs = tuple(replace(job, asked=False) for job in self.jobs)
        return replace(self, jobs=jobs)


# --- the conditions of design.toml ----------------------------------------------------------------


def plan_wanted(memory: Memory) -> bool:
    """Whether the first task needs a plan or a waiting one its schedule parameters, and pl and ta
    are not late.
    """
    return turn_come(memory) or parameters_wanted(memory) is not None


def turn_come(memory: Memory) -> bool:
    """Whether the first task needs a plan, which waits until pl has answered the recall of a
    question.
    """
    head = memory.first
    first = head is not None and head.stage is Stage.WAITING and not head.cancelling
    return first and not memory.loose and not any(job.recalled for job in memory.jobs)


def parameters_wanted(memory: Memory) -> Job | None:
    """The next task to ask pl about while another one runs, unless its answer could change nothing.

    One that is to be done after another one would only be planned for a world that is not there
    yet.
    """
    running = memory.first
    if running is None or running.stage is not Stage.RUNNING or not running.leavable:
        return None
    if (
        memory.loose
        or overtaken(memory)
        or any(job.stage is Stage.WAITING and job.talk for job in memory.jobs)
    ):
        return None
    waiting = ((at, job) for at, job in enumerate(memory.jobs) if job.waits and not job.asked)
    free = (job for at, job in waiting if not bound(memory.jobs, at))
    return next((job for job in free if job.command.urgency == running.command.urgency), None)


def bound(jobs: tuple[Job, ...], at: int) -> bool:
    """Whether a task comes after one before it in the queue."""
    return any(comes_after(jobs[at], job) for job in jobs[:at])


ANYTHING = "anything"
"""Stands for the objects of a command that names none."""


def comes_after(job: Job, earlier: Job) -> bool:
    """Whether a task comes after one said earlier: both are about the same object, or the sentence
    has this order.
    """
    mine, others = objects_of(job.command), objects_of(earlier.command)
    whatever = ANYTHING in mine | others and bool(mine and others)
    return job.command.after == earlier.conversation or bool(mine & others) or whatever


def objects_of(command: Command) -> frozenset[str]:
    """The kinds of objects that a command is about: jar and jar_1 may be the same one.

    {ANYTHING} for whatever is on the table, or in a hand; none for a look around.
    """
    if command.surveys:
        return frozenset()
    return frozenset(name.partition("_")[0] for name in command.things) or frozenset({ANYTHING})


def choice_open(memory: Memory) -> bool:
    """Whether there is a plan, a more urgent task or one with new schedule parameters, and no
    decision on it.
    """
    planned = memory.first is not None and memory.first.stage is Stage.PLANNED
    return memory.choice is Choice.OPEN and (planned or overtaken(memory) or _unweighed(memory))


def overtaken(memory: Memory) -> bool:
    """Whether a more urgent task waits than the one that runs or could, and nobody has asked ta to
    leave that.
    """
    job = memory.first
    if job is None or not job.leavable:
        return False
    return any(one.waits and one.command.urgency > job.command.urgency for one in memory.jobs[1:])


def _unweighed(memory: Memory) -> bool:
    """Whether a task with new schedule parameters waits, while another one runs."""
    running = memory.first
    if (
        running is None
        or running.stage is not Stage.RUNNING
        or not running.leavable
        or not running.schedule
    ):
        return False
    return any(job.waits and job.schedule and not job.weighed for job in memory.jobs[1:])


def switch_failed(memory: Memory) -> bool:
    """Whether there is no plan to switch to."""
    planned = memory.first is not None and memory.first.stage is Stage.PLANNED
    leavable = memory.first is not None and memory.first.leavable
    return memory.choice is Choice.SWITCH and not planned and not leavable


def triggered(memory: Memory) -> bool:
    """Whether there is something to do, or a plan has ended."""
    return bool(memory.arrived) or plan_wanted(memory) or choice_open(memory) or memory.over


def parameters_settled(memory: Memory) -> bool:
    """Whether no plan is awaited of pl, or a command of hi comes first."""
    planning = memory.first is not None and memory.first.stage is Stage.PLANNING
    return not planning or bool(memory.arrived)


CONDITIONS: dict[str, Callable[[Memory], bool]] = {
    "command_arrived": lambda memory: bool(memory.arrived),
    "plan_wanted": plan_wanted,
    "choice_open": choice_open,
    "triggered": triggered,
    "request_stored": lambda memory: not memory.arrived,
    "parameters_settled": parameters_settled,
    "decided": lambda memory: memory.choice is not Choice.OPEN,
    "switch": lambda memory: memory.choice is Choice.SWITCH,
    "switched": lambda memory: memory.choice is not Choice.SWITCH,
    "switch_failed": switch_failed,
}
