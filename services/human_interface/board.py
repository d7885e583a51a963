"""Display of hi for people: tasks, the latest events, answers to tickets. Between the thread of the agent and HTTP's.

Every wait ends. Must not know: HTTP, the agent.
"""

import itertools
import threading
import time
from collections import deque
from typing import Any

from companion.run_files import Events, HiEvent, Tasks
from services.human_interface.local import Answer, Shown, Told

KEPT_EVENTS = 1000


class Board:
    """Written by the agent, read by requests of people."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._numbers = itertools.count(1)
        self._answers: dict[str, Answer | None] = {}
        self._events: deque[HiEvent] = deque(maxlen=KEPT_EVENTS)
        self._tasks = Tasks(())
        self._told = 0
        self._closed = False

    def tell(self, content: Any) -> None:
        """Take a message of the agent."""
        with self._changed:
            match content:
                case Answer(ticket=ticket) if ticket in self._answers:
                    self._answers[ticket] = content
                case Told(event=event):
                    self._events.append(event)
                    self._told = event.n
                case Shown(tasks=tasks, events=events, wishes=wishes, questions=questions):
                    self._tasks = Tasks(tasks, wishes=wishes, questions=questions)
                    self._told = max(self._told, events)
            self._changed.notify_all()

    def close(self) -> None:
        """End all waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def ticket(self) -> str:
        """Return a new ticket; wait for it by `answer`."""
        with self._changed:
            ticket = str(next(self._numbers))
            self._answers[ticket] = None
            return ticket

    def answer(self, ticket: str, within_s: float) -> Answer | None:
        """Return the answer to a ticket; None if none came in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._answers[ticket] is not None, within_s)
            return self._answers.pop(ticket)

    def tasks(self) -> Tasks:
        """Return all tasks, oldest first, and what could be said."""
        with self._changed:
            return self._tasks

    def events(self, since: int, wait_s: float) -> Events:
        """Return the events after number `since`; wait up to `wait_s` [s] for one."""
        end = time.monotonic() + wait_s
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._told > since, max(0.0, end - time.monotonic()))
            return Events(self._told, tuple(event for event in self._events if event.n > since))
