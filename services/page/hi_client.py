"""hi as the page reaches it: docs/http.md, with the address and the token of hi.json. Blocks: for threads only."""

import http.client
import time
from pathlib import Path
from typing import TypeVar
from urllib.parse import urlencode

import msgspec

from companion.loopback import HERE, answered
from companion.run_files import HI_FILE, Cancel, Events, HiAddress, Problem, Say, TaskLine, Tasks
from companion.stop_words import AT_ONCE_S

ANSWER_S = 6.0
"""hi answers within 5 s, be it that it is busy."""
T = TypeVar("T")


class HiError(Exception):
    """hi refused something (`status`), or does not answer (0)."""

    def __init__(self, status: int, text: str) -> None:
        self.status = status
        super().__init__(text)


class Hi:
    """hi of the run whose `folder` has hi.json, at `host`. Every call raises HiError."""

    def __init__(self, folder: Path, host: str = HERE) -> None:
        self._file, self._host = folder / HI_FILE, host

    def say(self, said: Say) -> TaskLine:
        """Say a sentence; the task it became, or what was answered."""
        return self._ask("POST", "/say", TaskLine, said)

    def answers(self, asker: str) -> tuple[str, ...]:
        """Sentences that answer what hi has asked of somebody: none if it does not say so at once."""
        return self._ask("GET", "/tasks", Tasks, patience_s=AT_ONCE_S).answers(asker, time.time())

    def cancel(self, task: str, language: str) -> TaskLine:
        """Cancel a task."""
        return self._ask("POST", "/cancel", TaskLine, Cancel(task, language))

    def hold(self, held: bool) -> TaskLine:
        """Stop the robot, or let it go."""
        return self._ask("POST", "/stop" if held else "/release", TaskLine)

    def tasks(self) -> Tasks:
        """All tasks, and what could be said."""
        return self._ask("GET", "/tasks", Tasks)

    def events(self, since: int, wait_s: float) -> Events:
        """Events after a number; waits up to `wait_s` for one."""
        return self._ask(
            "GET", f"/events?{urlencode({'since': since, 'wait': wait_s})}", Events, patience_s=ANSWER_S + wait_s
        )

    def _ask(
        self, verb: str, path: str, kind: type[T], body: msgspec.Struct | None = None, patience_s: float = ANSWER_S
    ) -> T:
        try:
            address = msgspec.json.decode(self._file.read_bytes(), type=HiAddress)
            status, data = answered(address, verb, path, body, host=self._host, patience_s=patience_s)
            if status == http.client.OK:
                return msgspec.json.decode(data, type=kind)
            problem = msgspec.json.decode(data, type=Problem)
        except (OSError, http.client.HTTPException, msgspec.DecodeError) as error:
            raise HiError(0, f"the human interface does not answer: {error}") from error
        raise HiError(status, problem.error)
