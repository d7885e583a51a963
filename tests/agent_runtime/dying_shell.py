"""A shell that dies before a chosen line of its step's code, in a process of its own: `python
dying_shell.py <folder>`.

Prints a JSON list, an object for each line it died at: where; what had left the agent; what the
journal had; and the same after a second life, to which the peer said again what it had no receipt
for.
"""

import json
import os
import sys
from pathlib import Path
from types import FrameType
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import msgspec
from driven import World, request
from toy_agents import server, wirings

from agent_runtime.core.events import PeerChanged, Receipt, Started
from agent_runtime.core.state import Record
from agent_runtime.io import journal, shell
from agent_runtime.io.journal import journal_file
from agent_runtime.io.options import Options
from fipa_codec.communicate import Communicate

CODE = {Path(module.__file__).name for module in (shell, journal) if module.__file__}
REQUESTS = (1, 2)


class Outside(World):
    """Effects that left the agent, in a file that outlives it; in the place of wire and device."""

    def __init__(self, file: Path) -> None:
        self._file = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND)

    def send_receipt(self, receipt: Receipt) -> None:
        """Note it."""
        self._note(["receipt", receipt.taken])

    def send(self, communicate: Communicate, after: bytes = b"", heard: int = 0) -> int:
        """Note it."""
        number, act = int(communicate.id), str(communicate.performative)
        self._note(["said", number, act, communicate.conversation])
        return 1

    def _note(self, what: list[Any]) -> None:
        os.write(self._file, json.dumps(what).encode() + b"\n")


def left(run: Path) -> list[Any]:
    """Return the effects that left the agent so far."""
    return [json.loads(line) for line in (run / "world").read_text().splitlines()]


def life(run: Path, die_at: int) -> None:
    """One life in this process: requests without a receipt come; it dies before the nth line, 0:
    not at all.
    """
    world = Outside(run / "world")
    nowhere = dict.fromkeys(("server", "asker"), "tcp/127.0.0.1:1")
    options = Options(run_dir=run, system="toy", log_level="error", agents=nowhere)
    one: Any = shell.Shell(server(), wirings()[1], options)
    one._wire = one._device = world
    receipted = max((entry[1] for entry in left(run) if entry[0] == "receipt"), default=0)
    if die_at:
        sys.settrace(Killer(run, die_at))
    one._happen(Started())
    one._happen(PeerChanged("asker", 1, "peers"))
    for number in REQUESTS:
        if number > receipted:
            came = request(number, conversation=f"asker-1-{number}")
            one._happen(msgspec.structs.replace(came, journal="peers", believed=one._state.journal))
    sys.settrace(None)
    os._exit(0)


class Killer:
    """A trace function that ends the process before a line."""

    def __init__(self, run: Path, die_at: int) -> None:
        self._run, self._left = run, die_at

    def __call__(self, frame: FrameType, event: str, arg: Any) -> Any:
        name = Path(frame.f_code.co_filename).name
        if name not in CODE:
            return None
        if event == "line":
            self._left -= 1
            if not self._left:
                (self._run / "line").write_text(f"{name}:{frame.f_code.co_name}:{frame.f_lineno}")
                os._exit(9)
        return self


def forked(run: Path, die_at: int = 0) -> int:
    """Live in a process of its own; its exit status."""
    pid = os.fork()
    if not pid:
        try:
            life(run, die_at)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def journalled(run: Path) -> dict[str, Any]:
    """Return the journal's contents."""
    last = journal.last_record(journal_file(run, "server").read_bytes())
    if last is None:
        return {"taken": 0, "issued": 0, "worked": 0}
    record = msgspec.msgpack.decode(last, type=Record)
    memory = msgspec.msgpack.decode(record.memory)
    taken, issued = record.taken.get("asker", 0), record.issued.get("asker", 0)
    worked = len(memory["agreed"]) + len(memory["done"])
    return {"taken": taken, "issued": issued, "worked": worked}


def main(folder: Path) -> None:
    """Die at each line in turn, until one life gets through."""
    found, status, number = [], 9, 0
    while status == 9:
        number += 1
        run = folder / str(number)
        run.mkdir(parents=True)
        (run / "world").touch()
        status = forked(run, number)
        died = {"left": left(run), "journal": journalled(run)}
        line = (run / "line").read_text() if status == 9 else ""
        one = {"line": line, "status": status, "died": died, "again": forked(run)}
        found.append(one | {"left": left(run), "journal": journalled(run)})
    print(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
