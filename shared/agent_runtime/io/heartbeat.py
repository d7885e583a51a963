"""The heartbeat of an agent: a file and a message, each second and after each change, that say what it is at.

Where there is no room for a new file it is written over the old one, since who stands still is killed.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import msgspec

from agent_runtime.core.control import Answer, Value
from agent_runtime.core.inside import Inside
from agent_runtime.core.peers import Peers, Unheard
from agent_runtime.core.state import CoreState
from agent_runtime.io import clock
from agent_runtime.io.full_disk import overwrite
from agent_runtime.io.run_files import heartbeat_file, write_whole


class Heartbeat(msgspec.Struct, frozen=True):
    """<agent>.heartbeat.json and the key `_/state/<agent>`: state and work of the agent. `at`: unix seconds.

    `up`: whether it reaches the router, which is for tools. `inside`: what it has at hand; in the file only. `trouble`:
    why it waits, in words.
    """

    agent: str
    pid: int
    incarnation: int
    step: int
    state: str
    ready: bool
    up: bool
    peers: dict[str, int]
    unreceipted: dict[str, int]
    due: dict[str, int]
    counts: dict[str, int]
    at: float
    unheard: tuple[Unheard, ...] = ()
    paused: bool = False
    level: str = ""
    parameters: dict[str, Value] = {}
    answer: Answer = Answer()
    inside: Inside | None = None
    trouble: str = ""


def now(
    state: CoreState,
    peers: Peers,
    up: bool,
    unheard: tuple[Unheard, ...],
    dropped: Mapping[str, int],
    ready: bool,
    level: str,
    trouble: str,
) -> Heartbeat:
    """Return what the agent is at now, but for what it has at hand."""
    return Heartbeat(
        agent=state.agent,
        pid=os.getpid(),
        incarnation=state.incarnation,
        step=state.soft.step,
        state=state.state,
        ready=ready,
        up=up,
        peers=dict(peers.alive),
        unreceipted={peer: len(sent) for peer, sent in state.outbox.items()},
        due={peer: len(due) for peer, due in state.due.items()},
        counts=state.counts | {f"dropped {kind}": count for kind, count in dropped.items()},
        at=clock.now(),
        unheard=unheard,
        paused=state.paused,
        level=level,
        parameters=state.soft.parameters,
        answer=state.soft.answer,
        trouble=trouble,
    )


def ready_file(run: Path, agent: str) -> Path:
    """Return the file that says that an agent is ready."""
    return run / f"{agent}.ready"


def write(run: Path, whole: Heartbeat, short: Heartbeat) -> None:
    """Write the heartbeat, and once it is ready the file that says so; `short`: where there is little room."""
    file, ready = heartbeat_file(run, whole.agent), ready_file(run, whole.agent)
    try:
        write_whole(file, msgspec.json.encode(whole))
        if whole.ready and not ready.exists():
            write_whole(ready, str(whole.incarnation).encode())
    except OSError:
        with suppress(OSError):
            overwrite(file, msgspec.json.encode(msgspec.structs.replace(short, counts={}, parameters={})))
