"""A real router and agents as processes on free loopback ports; waits are for conditions, with a
deadline.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from agent_runtime.io.heartbeat import Heartbeat
from agent_runtime.io.options import AGENTS_VARIABLE, LISTEN_VARIABLE
from agent_runtime.io.reaching import free_port

DEADLINE_S = 30.0
TOY = Path(__file__).with_name("toy_process.py")


def wait_for(condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Look every 20 ms until the condition holds."""
    end = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end, f"not in {deadline_s} s: {what}"
        time.sleep(0.02)


class Fleet:
    """Processes of one run folder by name. `endpoint`: the router's; `agents`: those of the agents,
    linked directly.
    """

    def __init__(
        self,
        run: Path,
        script: Path = TOY,
        agents: Sequence[str] = ("asker", "server"),
        *,
        scheme: str = "tcp",
    ) -> None:
        self.run, self.script = run, script
        self.endpoint, *others = (
            f"{scheme}/127.0.0.1:{free_port()}" for _ in range(1 + len(agents))
        )
        self.agents = dict(zip(agents, others, strict=True))
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, *names: str) -> None:
        """Start processes (router, agents of the script) side by side, each with its output in a
        log.
        """
        for name in names:
            command = [sys.executable, str(self.script), name, self.endpoint, str(self.run)]
            if name == "router":
                command = [sys.executable, "-m", "services.router"]
            environment = os.environ | {
                "ROCO_RUN_DIR": str(self.run),
                LISTEN_VARIABLE: self.endpoint if name == "router" else "",
                AGENTS_VARIABLE: ",".join(
                    f"{agent}={endpoint}" for agent, endpoint in self.agents.items()
                ),
            }
            with (self.run / f"{name}.log").open("ab") as log:
                self.processes[name] = subprocess.Popen(
                    command, env=environment, stdout=log, stderr=log
                )

    def ready(self, *names: str) -> None:
        """Wait until these say that they are ready."""
        for name in names:
            wait_for(
                lambda name=name: (self.run / f"{name}.ready").exists(),
                f"{name} is ready\n{self.logs()}",
            )

    def kill(self, name: str) -> None:
        """kill -9."""
        self.processes[name].kill()
        self.processes.pop(name).wait()
        (self.run / f"{name}.ready").unlink(missing_ok=True)

    def stop(self, name: str) -> int:
        """SIGTERM; the exit status."""
        process = self.processes.pop(name)
        process.send_signal(signal.SIGTERM)
        return process.wait(DEADLINE_S)

    def want(self, number: int) -> None:
        """A word for the asker."""
        with (self.run / "want").open("a") as file:
            file.write(f"{number}\n")

    def beat(self, name: str) -> Heartbeat:
        """The agent's last heartbeat."""
        return msgspec.json.decode(
            (self.run / f"{name}.heartbeat.json").read_bytes(), type=Heartbeat
        )

    def logs(self) -> str:
        """Return the output of all processes."""
        return "\n".join(
            f"--- {log.name}\n{log.read_text()[-3000:]}" for log in sorted(self.run.glob("*.log"))
        )
