"""Two agents and a bare Zenoh get over the same router, turn by turn: the processes that communicates.py starts.

    python benchmarks/round_trip.py km|pl <endpoint> <run folder> [<plan as JSON>]

km and pl are the agents of the design on channel C4 (its links, rows, interfaces and languages), as they stand in their
processes: shell, core, journal, step log, wire. Only what they would compute is left out: km has its answers ready, pl
asks one question after the other. Beside them the same two processes hold a bare session each: a queryable that gives
bytes of the same number, and gets of them. pl asks in blocks by turns, both kinds on one thread.

A question takes from where pl's behaviour says it (turn.open) to where that behaviour has the answer, decoded, in its
hand, as a get takes from its call to its reply. With the own side's word before it (a step of its own) and the word to
the own side after it, it takes longer; both times are kept.
"""

import dataclasses
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import zenoh
from msgspec.structs import replace

from agent_runtime import shell
from agent_runtime.agent import Agent
from agent_runtime.devices import Post
from agent_runtime.events import Local, Received
from agent_runtime.options import Options
from agent_runtime.turn import Turn
from agent_runtime.zenoh_wire import client_config
from companion.binding import wiring
from companion.languages import LANGUAGES, wm
from companion.languages.values import Pose
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from services.knowledge import behaviours as knowing
from services.planner import behaviours as planning

SYSTEM = "bench"
WITHIN_S = 30.0
WM = LANGUAGES.named("WM")


class Plan(msgspec.Struct, frozen=True):
    """Which answer, asked for how often in a block, how many blocks of each kind, after how many to warm up."""

    answer: str
    block: int
    blocks: int
    warm: int


class Times(msgspec.Struct):
    """Of one plan: round trips [us] of the agents and of the bare gets, one list a block; bytes of the answer.

    `agents`: from behaviour to behaviour; `outside`: from the own side's word to the word to it.
    """

    answer: str
    size: int
    agents: list[list[float]] = []
    outside: list[list[float]] = []
    bare: list[list[float]] = []


# --- the answers ------------------------------------------------------------------------------------------------------


def _objects(size: int) -> wm.Objects:
    """Objects whose communicate has `size` bytes; the last one has a name that makes up the number."""
    few = tuple(wm.Object(f"box_{n}", "box1", "Container") for n in range(12 if size < 1000 else 1))
    short = len(encode(_said(Performative.INFORM_REF, wm.Objects(few))))
    return wm.Objects((*few[:-1], wm.Object("box_x" + "x" * (size - short), "box1", "Container")))


def _grasps(size: int) -> wm.Grasps:
    """Grasps, all numbers and short words, whose communicate has about `size` bytes."""
    step = wm.GraspStep(Pose((0.1, 0.2, 0.3), (0.5, 0.5, 0.5, 0.5)), 0.3)
    one = wm.GraspDef("17", (step, step, step), 1.0, 1.0, 1.0, 0.1, "side")
    each = len(msgspec.msgpack.encode(one))
    return wm.Grasps("jar_1", (one,) * (size // each))


def _said(act: Performative, content: Any) -> Communicate:
    """A communicate like those that will be sent: as many bytes."""
    there = act is Performative.QUERY_REF
    return Communicate(
        performative=act,
        content=WM.encode(content),
        language="WM",
        ontology="RoCo",
        protocol="query",
        reply_by=1.76e9 if there else None,
        reply_with="pl-1-1000" if there else "",
        in_reply_to="" if there else "pl-1-1000",
        conversation="pl-1-1000",
        sender="pl" if there else "km",
        receiver="km" if there else "pl",
        id="km-1-1000",
        sent=1.76e9,
    )


ANSWERS: dict[str, Callable[[], wm.AnyAnswer]] = {
    "654 B": lambda: _objects(654),
    "98 kB": lambda: _objects(98_000),
    "852 kB": lambda: _objects(852_000),
    "852 kB of grasps": lambda: _grasps(852_000),
}
READ_TOO = ("852 kB of grasps",)
"""Answers whose bare get encodes and decodes the content by plain msgspec: what reading costs whoever asks."""


# --- km ---------------------------------------------------------------------------------------------------------------


def km() -> Agent[Any]:
    """a_km, but that an answer stands ready under the name of the object whose grasps are asked for."""
    ready = {name: make() for name, make in ANSWERS.items()}

    def answer(memory: knowing.Memory, turn: Turn) -> knowing.Memory:
        question = memory.soft.question
        assert question is not None
        assert isinstance(question.query, wm.GraspSet)
        turn.say(question.conversation, Performative.INFORM_REF, ready[question.query.object])
        return replace(memory, soft=replace(memory.soft, question=None))

    real = knowing.agent()
    state = next(arc.target for arc in real.arcs if arc.when == "question_waits")
    mine = dataclasses.replace(real.behaviours[state], transition=answer)
    memory = knowing.Memory(patient=False)
    return dataclasses.replace(real, memory=memory, behaviours={**real.behaviours, state: mine})


class Queryable:
    """The bare side in km's process; a device only so that it ends with it."""

    busy = False

    def __init__(self, endpoint: str) -> None:
        self._session = zenoh.open(client_config(endpoint))
        ready = {name: make() for name, make in ANSWERS.items()}
        sized = {name: bytes(len(encode(_said(Performative.INFORM_REF, content)))) for name, content in ready.items()}

        def reply(query: zenoh.Query) -> None:
            with query:
                name = bytes(query.payload or b"").rstrip(b"\0").decode()
                data = msgspec.msgpack.encode(ready[name]) if name in READ_TOO else sized[name]
                query.reply(query.key_expr, data)

        self._declared = self._session.declare_queryable("bare/km", reply)

    def tell(self, content: Any) -> None:
        """What km tells its store."""

    def close(self) -> None:
        """End with the process."""
        self._session.close()  # type: ignore[no-untyped-call]


# --- pl ---------------------------------------------------------------------------------------------------------------


class Go(msgspec.Struct, frozen=True, tag=True):
    """Ask for this answer."""

    answer: str


class Came(msgspec.Struct, frozen=True, tag=True):
    """The answer is here, read and in its turn; how long the behaviour waited for it [us]."""

    took_us: float


class Begin(msgspec.Struct, frozen=True, tag=True):
    """The fleet has had time to find itself."""


def pl() -> Agent[Any]:
    """a_pl in its state of search, where each word of its own side is a question to km."""

    said: list[int] = []

    def forward(memory: planning.Memory, turn: Turn) -> planning.Memory:
        match turn.event:
            case Local(content=Begin()):
                turn.tell(Begin())
            case Local(content=Go(answer=answer)):
                query = wm.GraspSet(object=answer)
                said[:] = [time.perf_counter_ns()]
                turn.open("km", "query", Performative.QUERY_REF, query, reply_by_s=WITHIN_S)
            case Received(content=wm.Objects() | wm.Grasps()):
                turn.tell(Came((time.perf_counter_ns() - said[0]) / 1000))
        return memory

    real = planning.agent()
    mine = dataclasses.replace(real.behaviours["search"], transition=forward, terminal=_never, error=_never)
    return dataclasses.replace(real, start="search", behaviours={**real.behaviours, "search": mine}, local=Go | Begin)


def _never(memory: Any) -> bool:
    return False


class Asker:
    """pl's own side, on the thread that steps, so that no thread has to be woken that the fleet would not wake."""

    busy = False

    def __init__(self, post: Post, endpoint: str, run: Path, plans: list[Plan]) -> None:
        self._post, self._run, self._plans = post, run, plans
        self._session = zenoh.open(client_config(endpoint))
        self._times: list[Times] = []
        self._read = msgspec.msgpack.Decoder(wm.Content).decode
        self._left, self._warm, self._asked = 0, True, 0
        self._block, self._outside = list[float](), list[float]()
        post(Begin(), 1.0)

    def _begin(self) -> None:
        """The next plan, or the end."""
        if not self._plans:
            (self._run / "times.json").write_bytes(msgspec.json.encode(self._times))
            os.kill(os.getpid(), signal.SIGTERM)
            return
        plan = self._plans[0]
        size = len(encode(_said(Performative.INFORM_REF, ANSWERS[plan.answer]())))
        self._times.append(Times(plan.answer, size))
        self._warm = True
        self._bare(plan.warm)
        self._turn(plan.warm)

    def tell(self, content: Any) -> None:
        """An answer came: take the time, ask on, or let the bare gets have their turn."""
        now = time.perf_counter_ns()
        if isinstance(content, Begin):
            self._begin()
            return
        self._block.append(content.took_us)
        self._outside.append((now - self._asked) / 1000)
        self._left -= 1
        if self._left:
            self._ask()
        else:
            self._over()

    def _over(self) -> None:
        plan, times = self._plans[0], self._times[-1]
        if not self._warm:
            times.agents.append(self._block)
            times.outside.append(self._outside)
            times.bare.append(self._bare(plan.block))
            print(f"{plan.answer}: {len(times.bare)} of {plan.blocks} blocks", flush=True)
        self._warm = False
        if len(times.bare) < plan.blocks:
            self._turn(plan.block)
        else:
            self._plans.pop(0)
            self._begin()

    def _turn(self, count: int) -> None:
        self._left, self._block, self._outside = count, [], []
        self._ask()

    def _ask(self) -> None:
        self._asked = time.perf_counter_ns()
        self._post(Go(self._plans[0].answer))

    def _bare(self, count: int) -> list[float]:
        """So many gets one after the other; the time of one ends with its last reply in hand as bytes."""
        name = self._plans[0].answer
        size = len(encode(_said(Performative.QUERY_REF, wm.GraspSet(object=name))))
        asked, took = name.encode().ljust(size, b"\0"), []
        for _ in range(count):
            begin = time.perf_counter_ns()
            for reply in self._session.get("bare/km", payload=asked, timeout=WITHIN_S):
                data = reply.ok.payload.to_bytes()
                if name in READ_TOO:
                    self._read(data)
            took.append((time.perf_counter_ns() - begin) / 1000)
        return took

    def close(self) -> None:
        """End with the process."""
        self._session.close()  # type: ignore[no-untyped-call]


def main(name: str, endpoint: str, run: Path, plans: list[Plan]) -> int:
    """Serve as one of the two until told to stop, pl until its plans are done."""
    options = Options(connect=endpoint, run_dir=run, system=SYSTEM, log_level="warning")
    if name == "km":
        return shell.run(km(), wiring("km", SYSTEM), options, lambda post: Queryable(endpoint))
    return shell.run(pl(), wiring("pl", SYSTEM), options, lambda post: Asker(post, endpoint, run, plans))


if __name__ == "__main__":
    asked = msgspec.json.decode(sys.argv[4], type=list[Plan]) if len(sys.argv) > 4 else []
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), asked))
