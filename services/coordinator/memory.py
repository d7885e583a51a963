"""What co remembers: the tasks in order of arrival, how far the first of them is, and talks that outlive their task.

One task at a time: the first job is planned and run, the others wait (scheduling by cost and deadline comes later).
Must not know: messages, time but as numbers it is given.
"""

from enum import StrEnum

import msgspec

from companion.languages import cmd, hfsm


class Limits(msgspec.Struct, frozen=True):
    """How long co waits, how much it takes on. Seconds of wall time but where `speed` scales them."""

    planning_s: float = (
        180.0  # reply-by of a request for a plan: 6 s on two cores, over 60 s at a load of 17 (measured)
    )
    cancel_planning_s: float = 10.0  # pl forwards only, so a cancel is taken at once (estimate)
    cancel_acting_s: float = 240.0  # two things put down and two arms home take 60 s, tried twice (measured)
    patience_s: float = 60.0  # how long waiting tasks wait on when pl or ta is late (estimate)
    replans: int = 6  # new plans of one task before it is given up (estimate)
    looks: int = 120  # askings while the robot looks around; km holds each for 5 s, so that is 10 min (estimate)
    waiting: int = 5  # open tasks: an agree and two last words each stay below the outbox bound, should hi be dead
    speed: float = 1.0  # simulated seconds in a wall second; "max" counts as 1: it is no slower (estimate)

    def acting_s(self, plan: hfsm.HierarchicalPlan) -> float:
        """Reply-by of a plan [s from now]: five times its planned duration and 10 s, at this speed."""
        return (5.0 * plan.duration + 10.0) / self.speed


class Stage(StrEnum):
    """How far a task is."""

    WAITING = "waiting"
    PLANNING = "planning"
    PLANNED = "planned"
    RUNNING = "running"


class Choice(StrEnum):
    """What state `schedule` decided on the plan that lies before it."""

    OPEN = "open"
    CONTINUE = "continue"
    SWITCH = "switch"


class Job(msgspec.Struct, frozen=True, omit_defaults=True):
    """A task of hi. `conversation`: hi's, and the task's name; `talk`: the one with pl (PLANNING) or ta (RUNNING).

    `arrived`: unix time [s]; `plans`: how many were asked for; `at`: the state of the plan hi was told last.
    `looks`: how often the plan had to wait for a look around.
    """

    conversation: str
    command: cmd.Task
    arrived: float
    stage: Stage = Stage.WAITING
    talk: str = ""
    plans: int = 0
    looks: int = 0
    plan: hfsm.HierarchicalPlan | None = None
    at: str = ""
    cancelling: bool = False


class Memory(msgspec.Struct, frozen=True, omit_defaults=True):
    """`arrived`: commands taken and not stored yet; `over`: a task has just ended; `loose`: talks with pl or ta whose
    reply-by passed, so that hi was told already, and whose last word is still to come.
    """

    arrived: tuple[Job, ...] = ()
    jobs: tuple[Job, ...] = ()
    choice: Choice = Choice.OPEN
    over: bool = False
    loose: tuple[str, ...] = ()

    @property
    def first(self) -> Job | None:
        """The task that is worked on, or will be next."""
        return self.jobs[0] if self.jobs else None

    def of_hi(self, conversation: str) -> Job | None:
        """The task of a conversation with hi."""
        return next((job for job in self.jobs if job.conversation == conversation), None)

    def of_talk(self, conversation: str) -> Job | None:
        """The task that a conversation with pl or ta serves."""
        return next((job for job in self.jobs if job.talk == conversation), None)

    def with_job(self, job: Job) -> "Memory":
        """The same with this task as it now is."""
        jobs = tuple(job if one.conversation == job.conversation else one for one in self.jobs)
        return msgspec.structs.replace(self, jobs=jobs)

    def without_job(self, job: Job) -> "Memory":
        """The same less a task that has ended."""
        jobs = tuple(one for one in self.jobs if one.conversation != job.conversation)
        return msgspec.structs.replace(self, jobs=jobs, over=True, choice=Choice.OPEN)


# --- the conditions of design.toml ------------------------------------------------------------------------------------


def command_arrived(memory: Memory) -> bool:
    """A command of hi is not stored yet."""
    return bool(memory.arrived)


def plan_wanted(memory: Memory) -> bool:
    """The first task has no plan, none was asked for, and pl and ta are at our service."""
    return memory.first is not None and memory.first.stage is Stage.WAITING and not memory.loose


def choice_open(memory: Memory) -> bool:
    """A plan is there, and nothing was decided on it."""
    return memory.first is not None and memory.first.stage is Stage.PLANNED and memory.choice is Choice.OPEN


def triggered(memory: Memory) -> bool:
    """There is something to do, or a plan has ended."""
    return command_arrived(memory) or plan_wanted(memory) or choice_open(memory) or memory.over


def request_stored(memory: Memory) -> bool:
    """No command waits to be stored."""
    return not memory.arrived


def parameters_settled(memory: Memory) -> bool:
    """Pl owes us no plan; or hi wants to be heard before it comes."""
    planning = memory.first is not None and memory.first.stage is Stage.PLANNING
    return not planning or command_arrived(memory)


def decided(memory: Memory) -> bool:
    """Continue or switch."""
    return memory.choice is not Choice.OPEN


def switch(memory: Memory) -> bool:
    """The decision is switch."""
    return memory.choice is Choice.SWITCH


def switched(memory: Memory) -> bool:
    """Ta has the plan."""
    return memory.choice is not Choice.SWITCH


def switch_failed(memory: Memory) -> bool:
    """There is no plan to switch to."""
    return switch(memory) and (memory.first is None or memory.first.stage is not Stage.PLANNED)


CONDITIONS = {
    condition.__name__: condition
    for condition in (
        command_arrived,
        plan_wanted,
        choice_open,
        triggered,
        request_stored,
        parameters_settled,
        decided,
        switch,
        switched,
        switch_failed,
    )
}
