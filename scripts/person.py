"""A person's program beside the fleet in containers: it says sentences to hi and looks what became
of them.
"""

import json
import urllib.error
import urllib.request

from containers import Docker, Failed, wait

RUN = "/var/lib/roco/run"
ENDED = ("done", "failed", "cancelled", "refused")
ANSWER_S = 15.0  # estimate: hi answers in milliseconds
UP_S, TASK_S = 120.0, 240.0  # estimates: three times and more what a loaded 2-core machine needs


class Person:
    """Talks to hi over its port, as docs/http.md says. The token is new at each start of hi: read
    for each word.
    """

    def __init__(self, docker: Docker) -> None:
        self._docker = docker

    def ask(self, path: str, body: dict[str, str] | None = None) -> dict:
        """The answer. Failed with what hi said instead, OSError where nobody answers."""
        told = json.loads(self._docker.execute("hi", "cat", f"{RUN}/hi.json"))
        headers = {"Authorization": f"Bearer {told['token']}", "Content-Type": "application/json"}
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"http://127.0.0.1:{told['port']}{path}", data, headers)
        try:
            with urllib.request.urlopen(request, timeout=ANSWER_S) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            raise Failed(f"{path}: {error.code} {error.read().decode(errors='replace')}") from error

    def accepted(self, sentence: str) -> str:
        """Say a sentence until it is taken; its task."""

        def say() -> str:
            line = self.ask("/say", {"text": sentence})
            if line["state"] == "refused":
                raise Failed(line["text"])
            return line["task"]

        return wait(f"{sentence!r} was not accepted", UP_S, say)

    def now(self, task: str) -> dict:
        """A task as it stands."""
        return next(line for line in self.ask("/tasks")["tasks"] if line["task"] == task)

    def reached(self, task: str, states: tuple[str, ...]) -> dict:
        """A task once it is in one of these states, or has ended."""

        def look() -> dict | None:
            line = self.now(task)
            return line if line["state"] in (*states, *ENDED) else None

        return wait(f"{task} is not {' or '.join(states)}", TASK_S, look)

    def done(self, task: str) -> dict:
        """A task at its end, which must be `done`."""
        line = self.reached(task, ENDED)
        if line["state"] != "done":
            raise Failed(f"{line['said']} ended {line['state']}, not done: {line['text']}")
        return line

    def served(self, sentence: str) -> None:
        """Say a sentence and wait until it is done."""
        self.done(self.accepted(sentence))


def status(address: str) -> int:
    """The status that somebody without token gets at an address of http. OSError where nobody
    answers.
    """
    try:
        with urllib.request.urlopen(address, timeout=ANSWER_S) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code
