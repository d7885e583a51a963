"""A pretended fleet for the console's tests: one process that writes a run folder, answers as a_hi,
reports at SIGTERM.

Called as `fake_fleet.py services.supervisor RUN SUCCESS [MODE]`; the first word makes it look like
the supervisor. MODE `starting`: it never gets ready; `slow`: nor does it end at once, but when
RUN/may-end is there.
"""

import http.server
import os
import signal
import sys
import threading
import time
from pathlib import Path

import msgspec

from agent_runtime.io.run_files import STOP_FILE, STOP_RELEASED, heartbeat_file
from companion import run_files
from companion.run_files import HiAddress, TaskLine
from companion.tools.system import JOB
from operate import file_names, fleet_file
from operate.fleet_file import Fleet, ProcessStatus
from operate.live_lines import AgentIn, Happened, PlanAt, PlanSeen, Sent, Step, Task

TOKEN = "a token"
BEAT_S = 0.1
"""Between two heartbeats of each agent: all are at rest."""
BESIDE = "beside"
"""Name of a file that is still being written."""
QUERY = {"protocol": "query", "performative": "query-ref"}
TAKE = Step(("take",), "take", ("jar_1",))
GRASP = Step(("take", "grasp"), "take", ("jar_1",), act="Grasp")
TILT = Step(("pour",), act="Pour")
STORY = (
    AgentIn(t=1.0, agent="ta", state="running"),
    PlanSeen(t=1.0, plan="p1", tasks=(Task("pour"),), states=(TAKE, GRASP, TILT)),
    PlanAt(t=1.5, at=GRASP),
    Sent(t=2.0, channel="C4", sender="pl", receiver="km", bytes=231, **QUERY),
    Happened(t=3.0, name="grasped", of=("jar_1",), text="left hand"),
    PlanAt(t=4.0, at=TILT, outcome="succeeded"),
)


class Answers(http.server.BaseHTTPRequestHandler):
    """The part of docs/http.md that the console uses; a task is done at the second look."""

    task: TaskLine | None = None
    looks = 0

    def do_POST(self) -> None:
        """Take a sentence, or a cancel."""
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if self.path == "/say":
            said = msgspec.json.decode(body, type=run_files.Say).text
            known = "pour" in said
            answer = TaskLine(
                "hi-1-1" if known else "", "waiting" if known else "refused", "I can pour", said
            )
            Answers.task = answer if known else None
            self.reply(answer)
        elif Answers.task is None:
            self.reply(run_files.Problem("no task has not ended"), 404)
        else:
            self.reply(Answers.task)

    def do_GET(self) -> None:
        """Tell the tasks."""
        Answers.looks += 1
        task = Answers.task
        if task is not None and Answers.looks > 1:
            Answers.task = task = msgspec.structs.replace(task, state="done")
        self.reply(run_files.Tasks((task,) if task else ()))

    def reply(self, what: msgspec.Struct, code: int = 200) -> None:
        """Answer, to those with the token."""
        allowed = self.headers["Authorization"] == f"Bearer {TOKEN}"
        self.send_response(code if allowed else 401)
        self.end_headers()
        self.wfile.write(msgspec.json.encode(what if allowed else run_files.Problem("wrong token")))

    def log_message(self, *words: object) -> None:
        """Say nothing."""


def put(file: Path, data: bytes) -> None:
    """Write a file as a whole."""
    whole = file.with_name(BESIDE)
    whole.write_bytes(data)
    whole.replace(file)


def beat(run: Path) -> None:
    """Write a heartbeat of each agent."""
    for agent, rest in JOB.rests.items():
        put(heartbeat_file(run, agent), msgspec.json.encode({"state": rest, "at": time.time()}))


def main(run: Path, success: bool, mode: str) -> None:
    """Be a fleet until SIGTERM."""
    server = http.server.HTTPServer(("127.0.0.1", 0), Answers)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    end = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: end.set())
    encode = msgspec.json.encode
    (run / STOP_FILE).write_bytes(STOP_RELEASED)
    (run / run_files.HI_FILE).write_bytes(encode(HiAddress(server.server_port, TOKEN)))
    (run / file_names.LIVE_FILE).write_bytes(b"".join(encode(line) + b"\n" for line in STORY))
    state = fleet_file.ProcessState.READY if mode == "ready" else fleet_file.ProcessState.STARTING
    processes = (ProcessStatus("ta", state, os.getpid(), module="services.supervisor"),)
    beat(run)
    put(run / file_names.FLEET_FILE, encode(Fleet("test", "", os.getpid(), time.time(), processes)))
    while not end.wait(BEAT_S):
        beat(run)
    while mode == "slow" and not (run / "may-end").exists():
        time.sleep(0.02)
    server.shutdown()
    report = {"success": success, "failure": None if success else "the jar slipped"}
    report |= {"poured_fraction": 0.97, "sim_time_s": 98.5, "wall_time_s": 120.0}
    (run / file_names.REPORT_FILE).write_bytes(encode(report))


if __name__ == "__main__":
    main(Path(sys.argv[2]), sys.argv[3] == "True", *(sys.argv[4:] or ["ready"]))
