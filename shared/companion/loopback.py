"""Clients of hi (docs/http.md) and of the page, which let in who has the token. They block: for
threads.
"""

import http.client
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar
from urllib.parse import urlencode

import msgspec

from companion.run_files import (
    Cancel,
    Events,
    HiAddress,
    PageAddress,
    Problem,
    Say,
    TaskLine,
    Tasks,
)
from companion.stop_words import AT_ONCE_S

HERE = "127.0.0.1"
ANSWER_S = 10.0
"""hi answers within 5 s, be it that it is busy (estimate: a busy machine)."""
T = TypeVar("T")


def answered(
    address: HiAddress | PageAddress,
    verb: str,
    path: str,
    body: msgspec.Struct | None = None,
    *,
    host: str = HERE,
    patience_s: float,
) -> tuple[int, bytes]:
    """Status and body of the answer. `host`: where it listens if not here; it is asked by the name
    it expects.

    Raise OSError or http.client.HTTPException where nobody answers within `patience_s` [s].
    """
    connection = http.client.HTTPConnection(host, address.port, timeout=patience_s)
    headers = {"Authorization": f"Bearer {address.token}", "Content-Type": "application/json"}
    headers["Host"] = f"{HERE}:{address.port}"
    try:
        connection.request(
            verb, path, msgspec.json.encode(body) if body is not None else b"", headers
        )
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


class HiError(Exception):
    """hi refused something (`status`), or does not answer (0)."""

    def __init__(self, status: int, reason: str) -> None:
        self.status, self.reason = status, reason
        super().__init__(reason)


class Hi:
    """hi at an address, or at that in a file, which is read for each request: hi may have come back
    at another one.

    Every call raises HiError, or the one of a sub-class: status 0 where nobody answers, else what
    hi said.
    """

    error: Callable[[int, str], Exception] = HiError

    def __init__(
        self, address: HiAddress | Path, host: str = HERE, patience_s: float = ANSWER_S
    ) -> None:
        self._address, self._host, self._patience_s = address, host, patience_s

    def send(self, said: Say) -> TaskLine:
        """Say a sentence; the task it became, or what was answered."""
        return self._ask("POST", "/say", TaskLine, said)

    def answers(self, asker: str) -> tuple[str, ...]:
        """Sentences that answer what hi has asked of somebody: none if it does not say so at
        once.
        """
        return self._ask("GET", "/tasks", Tasks, patience_s=AT_ONCE_S).answers(asker, time.time())

    def cancel(self, task: str = "", language: str = "en") -> TaskLine:
        """Cancel this task, or the oldest that has not ended."""
        return self._ask("POST", "/cancel", TaskLine, Cancel(task, language))

    def hold(self, held: bool) -> TaskLine:
        """Stop the robot, or let it move again; no agent is asked."""
        return self._ask("POST", "/stop" if held else "/release", TaskLine)

    def told(self) -> Tasks:
        """All tasks, what could be said, and what is asked."""
        return self._ask("GET", "/tasks", Tasks)

    def tasks(self) -> tuple[TaskLine, ...]:
        """All tasks, oldest first."""
        return self.told().tasks

    def events(self, since: int = 0, wait_s: float = 0.0) -> Events:
        """Events after number `since`; waits up to `wait_s` [s] for one."""
        query = urlencode({"since": since, "wait": wait_s})
        return self._ask("GET", f"/events?{query}", Events, patience_s=self._patience_s + wait_s)

    def _ask(
        self,
        verb: str,
        path: str,
        kind: type[T],
        body: msgspec.Struct | None = None,
        patience_s: float = 0.0,
    ) -> T:
        at, address = "", self._address
        try:
            if isinstance(address, Path):
                address = msgspec.json.decode(address.read_bytes(), type=HiAddress)
            at = f" on port {address.port}"
            patience_s = patience_s or self._patience_s
            status, data = answered(
                address, verb, path, body, host=self._host, patience_s=patience_s
            )
        except (OSError, http.client.HTTPException, msgspec.DecodeError) as error:
            raise self.error(
                0, f"the human interface does not answer{at} ({error}); see `roco status`"
            ) from error
        if status != http.client.OK:
            try:
                reason = msgspec.json.decode(data, type=Problem).error
            except msgspec.DecodeError:
                reason = data[:200].decode(errors="replace") or "no reason given"
            raise self.error(status, reason)
        try:
            return msgspec.json.decode(data, type=kind)
        except msgspec.DecodeError as error:
            raise self.error(
                status, f"{path} answered something else than {kind.__name__}: {error}"
            ) from error
