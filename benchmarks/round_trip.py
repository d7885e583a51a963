"""Two agents on channel C4, or two bare Zenoh sessions: the processes that fleets.py starts.

    python benchmarks/round_trip.py km|pl|queryable|getter ADDRESS RUN_FOLDER DESCRIPTOR

Times are written to the descriptor.

km and pl are the agents of the design on channel C4 (its links, rows, interfaces and languages), as
they stand in their processes: shell, core, journal, step log, wire. Only what they would compute is
left out: km has its answers ready, pl asks one question after the other. queryable and getter are
the bare thing: a session each with the settings of the agents' sessions, a queryable that gives
bytes of the same number, and gets of them.

A question takes from where pl's behaviour says it (turn.open) to where that behaviour has the
answer, decoded, in its hand, as a get takes from its call to its reply. pl and getter ask a block
for each line of standard input, and give its times as a line.
"""

import dataclasses
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import zenoh
from msgspec.structs import replace

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Local, Received
from agent_runtime.core.turn import Turn
from agent_runtime.io import shell
from agent_runtime.io.cli import endpoints
from agent_runtime.io.devices import Post
from agent_runtime.io.options import AGENTS_VARIABLE, Options
from agent_runtime.io.sessions import client_config, keep_memory
from companion.design import LANGUAGES, wiring
from companion.languages import wm
from companion.languages.values import Pose
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from services.knowledge import behaviours as knowing
from services.planner import behaviours as planning

SYSTEM = "bench"
WITHIN_S = 30.0
WM = LANGUAGES.named("WM")


class Block(msgspec.Struct, frozen=True):
    """Ask `count` questions for this answer, one after the other."""

    answer: str
    count: int


# --- the answers ----------------------------------------------------------------------------------


def _objects(size: int) -> wm.Objects:
    """Objects whose communicate has `size` bytes; the last one has a name that makes up the
    number.
    """
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
"""Answers whose bare get encodes and decodes the content by plain msgspec: what reading
costs.
"""


# --- km -------------------------------------------------------------------------------------------


def km() -> Agent[Any]:
    """km, but that an answer stands ready under the name of the object whose grasps are asked
    for.
    """
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


class Store:
    """km's own side, which has nothing to keep."""

    busy = False

    def tell(self, content: Any) -> None:
        """Ignore km's message to its store."""

    def close(self) -> None:
        """Nothing to close."""


# --- pl -------------------------------------------------------------------------------------------


class Go(msgspec.Struct, frozen=True, tag=True):
    """Ask for this answer."""

    answer: str


class Came(msgspec.Struct, frozen=True, tag=True):
    """The answer is here, read and in its turn; how long the behaviour waited for it [us]."""

    took_us: float


class Begin(msgspec.Struct, frozen=True, tag=True):
    """The fleet has had time to find itself."""


def pl() -> Agent[Any]:
    """pl in its state of search, where each word of its own side is a question to km."""

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
    mine = dataclasses.replace(
        real.behaviours["search"], transition=forward, terminal=_never, error=_never
    )
    return dataclasses.replace(
        real, start="search", behaviours={**real.behaviours, "search": mine}, local=Go | Begin
    )


def _never(memory: Any) -> bool:
    return False


class Turns:
    """pl's own side: a block of questions for each line of standard input, its times [us] as a line
    of `out`.

    The thread that steps tells it, so that no other thread is woken than in a fleet.
    """

    busy = False

    def __init__(self, post: Post, out: int) -> None:
        self._post, self._out = post, out
        self._left, self._times, self._answer = 0, list[float](), ""
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for block in blocks():
            self._left, self._times, self._answer = block.count, [], block.answer
            self._post(Go(self._answer))

    def tell(self, content: Any) -> None:
        """An answer came: ask on, or give the times."""
        if not isinstance(content, Came):
            return
        self._times.append(content.took_us)
        self._left -= 1
        if self._left:
            self._post(Go(self._answer))
        else:
            give(self._out, self._times)

    def close(self) -> None:
        """End with the process."""
        os.close(self._out)


def blocks() -> Iterator[Block]:
    """Yield the blocks that standard input asks for."""
    # unbuffered: its lock would hold up the end
    with os.fdopen(0, "rb", buffering=0, closefd=False) as lines:
        for line in lines:
            yield msgspec.json.decode(line, type=Block)


def give(out: int, times: list[float]) -> None:
    """The times of a block, as a line."""
    data = msgspec.json.encode(times) + b"\n"
    while data:
        data = data[os.write(out, data) :]


# --- the bare thing -------------------------------------------------------------------------------


def queryable(address: str, run: Path) -> int:
    """Reply until told to stop."""
    keep_memory()
    ready = {name: make() for name, make in ANSWERS.items()}
    sized = {
        name: bytes(len(encode(_said(Performative.INFORM_REF, content))))
        for name, content in ready.items()
    }

    def reply(query: zenoh.Query) -> None:
        with query:
            name = bytes(query.payload or b"").rstrip(b"\0").decode()
            query.reply(
                query.key_expr,
                msgspec.msgpack.encode(ready[name]) if name in READ_TOO else sized[name],
            )

    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with zenoh.open(client_config(address)) as session:
        declared = session.declare_queryable("bare/km", reply)
        (run / "queryable.ready").touch()
        ended.wait()
        declared.undeclare()
    return 0


def getter(address: str, out: int) -> int:
    """Gets, as asked for, until standard input ends; the time of one ends with its last reply in
    hand as bytes.
    """
    keep_memory()
    read = msgspec.msgpack.Decoder(wm.Content).decode
    with zenoh.open(client_config(address)) as session:
        for block in blocks():
            size = len(encode(_said(Performative.QUERY_REF, wm.GraspSet(object=block.answer))))
            asked, took = block.answer.encode().ljust(size, b"\0"), list[float]()
            while len(took) < block.count:
                begin = time.perf_counter_ns()
                for reply in session.get("bare/km", payload=asked, timeout=WITHIN_S):
                    data = reply.ok.payload.to_bytes()
                    if block.answer in READ_TOO:
                        read(data)
                took.append((time.perf_counter_ns() - begin) / 1000)
            give(out, took)
    return 0


def main(name: str, address: str, run: Path, out: int) -> int:
    """Serve as one of the four until told to stop."""
    if name == "queryable":
        return queryable(address, run)
    if name == "getter":
        return getter(address, out)
    keys = Path(os.environ["ROCO_TLS_DIR"]) if os.environ.get("ROCO_TLS_DIR") else None
    system = os.environ.get("ROCO_SYSTEM", SYSTEM)
    agents = endpoints(os.environ.get(AGENTS_VARIABLE, ""))
    options = Options(
        connect=address, run_dir=run, system=system, log_level="error", keys=keys, agents=agents
    )
    if name == "km":
        return shell.run(km(), wiring("km", system), options, lambda post: Store())
    return shell.run(pl(), wiring("pl", system), options, lambda post: Turns(post, out))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), int(sys.argv[4])))
