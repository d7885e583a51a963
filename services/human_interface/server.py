"""The HTTP service of hi on the loopback interface, as in docs/http.md.

A request posts a message to the agent and waits for the answer until a deadline; one loop, in a
thread of its own, serves all of them. A stop waits for nobody: the loop sets the flag before it
reads the request's body. A sentence is read here, too: the agent's step gets its meaning. Must not
know: tasks, Zenoh.
"""

import asyncio
import contextlib
import itertools
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import msgspec
from msgspec.structs import replace
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from agent_runtime.io.devices import Post
from agent_runtime.io.run_files import LOOPBACK, write_secret
from companion.loopback_server import (
    Refused,
    RobotStop,
    Server,
    check_host,
    has_token,
    listener,
    loopback_hosts,
    whole_body,
)
from companion.run_files import (
    HELD,
    HI_FILE,
    LET_GO,
    RELEASED,
    STOPPED,
    Cancel,
    Events,
    HiAddress,
    HiEvent,
    Problem,
    Say,
    TaskLine,
    Tasks,
)
from companion.stop_words import calls_for_help, stop_words
from services.human_interface import times
from services.human_interface.catalogue import abilities, say
from services.human_interface.device_messages import (
    Answer,
    CancelWanted,
    Halted,
    NewEvent,
    Sentence,
    Shown,
    StopRobot,
)
from services.human_interface.grammar import understand

# --- Display of hi for people: tasks, the latest events, answers to tickets. For one event loop ---

KEPT_EVENTS = 1000


class Board:
    """Written by the agent, read by requests of people. Every wait ends."""

    def __init__(self) -> None:
        self.tasks = Tasks(())
        self._changed = asyncio.Event()
        self._numbers = itertools.count(1)
        self._answers: dict[str, Answer | None] = {}
        self._events: deque[HiEvent] = deque(maxlen=KEPT_EVENTS)
        self._told = 0
        self._closed = False

    def tell(self, content: Any) -> None:
        """Take a message of the agent."""
        match content:
            case Answer(ticket=ticket) if ticket in self._answers:
                self._answers[ticket] = content
            case NewEvent(event=event):
                self._events.append(event)
                # nobody hears of it before the tasks as it left them: who is woken asks for these
                # next
                return
            case Shown() as shown:
                self.tasks = Tasks(
                    shown.tasks,
                    wishes=shown.wishes,
                    questions=shown.questions,
                    hands=shown.hands,
                )
                self._told = max(self._told, shown.events)
        self._wake()

    def close(self) -> None:
        """End all waits."""
        self._closed = True
        self._wake()

    def ticket(self) -> str:
        """A new ticket; wait for it by `answer`."""
        ticket = str(next(self._numbers))
        self._answers[ticket] = None
        return ticket

    async def answer(self, ticket: str, within_s: float) -> Answer | None:
        """The answer to a ticket; None if none came in time."""
        try:
            await self._until(lambda: self._answers[ticket] is not None, within_s)
        finally:
            answer = self._answers.pop(ticket)
        return answer

    async def events(self, since: int, wait_s: float) -> Events:
        """The events after number `since`; wait up to `wait_s` [s] for one."""
        await self._until(lambda: self._told > since, wait_s)
        told = tuple(event for event in self._events if since < event.n <= self._told)
        return Events(self._told, told)

    async def _until(self, holds: Callable[[], bool], within_s: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                while not (self._closed or holds()):
                    await self._changed.wait()

    def _wake(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()


# --- The requests ---------------------------------------------------------------------------------

ANSWER_S = 5.0  # the agent answers in a step, some ms; estimate for a busy machine
LONGEST_WAIT_S = 10.0
AT_ONCE = 32  # requests served at the same time (estimate: some consoles and pages)
OUT_OF_REACH = (
    "I cannot stop the robot from here: its control loop has another run folder. I cancel all tasks"
    " instead, and what is held is put down. Where the robot runs, `roco stop` stops it at once"
)
NOT_HELD_HERE = (
    "I cannot release the robot from here: its loop has another run folder; `roco release` does it"
    " there"
)


class HttpApp:
    """The ASGI application: what can be asked of hi, by those who have the token of its address."""

    def __init__(self, address: HiAddress, post: Post, robot: RobotStop) -> None:
        self.board = Board()
        self.waiting = 0
        self._address, self._post, self._robot = address, post, robot
        self._routes = {
            "/say": ("POST", self._say),
            "/cancel": ("POST", self._cancel),
            "/stop": ("POST", self._stop),
            "/release": ("POST", self._release),
            "/tasks": ("GET", self._tasks),
            "/events": ("GET", self._events),
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check the sender, then the request; answer it."""
        request, status = Request(scope, receive), 200
        try:
            check_host(request.headers, loopback_hosts(self._address.port))
            if not has_token(request.headers, self._address.token):
                bearer = "Authorization: Bearer <token>"
                text = f"wrong or missing token; send `{bearer}` with that of {HI_FILE}"
                raise Refused(401, text)
            path = scope["path"]
            if path not in self._routes:
                raise Refused(404, f"there is no {path}; there are {', '.join(self._routes)}")
            verb, serve = self._routes[path]
            if request.method != verb:
                raise Refused(405, f"{path} wants {verb}, not {request.method}")
            said = await serve(request)
        except Refused as refused:
            status, said = refused.status, Problem(str(refused))
        headers = {"cache-control": "no-store", "connection": "close"}
        await Response(msgspec.json.encode(said), status, headers, "application/json")(
            scope, receive, send
        )

    def hold(self, held: bool, said: str = "") -> TaskLine:
        """Stop the robot or let it go, then tell the agent, which nothing waits for. Raise Refused
        where that fails.
        """
        try:
            reached = self._robot.hold(held)
        except OSError as error:
            raise Refused(503, f"the stop flag cannot be written: {error}") from error
        text = (HELD if held else LET_GO) if reached else (OUT_OF_REACH if held else NOT_HELD_HERE)
        self._post(Halted(held, reached, text))
        if not reached:
            raise Refused(503, text)
        return TaskLine("", STOPPED if held else RELEASED, text, said, time.time())

    async def _say(self, request: Request) -> msgspec.Struct:
        said = await _content(request, Say)
        text = said.text
        now = time.time()
        if stop_words(text, self.board.tasks.answers(said.asker, now)):
            line = self.hold(True, text)
            language = calls_for_help(text)
            text = say(language, "helped", abilities(language)) if language else line.text
            return replace(line, text=text)
        with self._room():
            meaning = await asyncio.to_thread(understand, text)
            ticket = self.board.ticket()
            urgency = max(said.urgency, int(meaning.when.urgent))
            east = time.localtime().tm_gmtoff // 60 if said.east_min is None else said.east_min
            minute_of_day = (now / 60.0 + east) % times.DAY
            within_s = said.within_s or times.seconds_left(meaning.when, minute_of_day)
            later_s = said.later_s or times.seconds_until(meaning.when, minute_of_day)
            held, when = self._robot.held, (urgency, within_s, later_s)
            word = Sentence(ticket, text, meaning, held, *when, said.instead, said.asker, now, east)
            self._post(replace(word, careful=said.careful))
            return await self._answer(ticket)

    async def _stop(self, request: Request) -> msgspec.Struct:
        return await self._whatever_the_body(request, True)

    async def _release(self, request: Request) -> msgspec.Struct:
        return await self._whatever_the_body(request, False)

    async def _whatever_the_body(self, request: Request, held: bool) -> msgspec.Struct:
        """Stop first; then take a body, so that its sender reads the answer."""
        try:
            return self.hold(held)
        finally:
            with contextlib.suppress(Refused):
                await whole_body(request)

    async def _cancel(self, request: Request) -> msgspec.Struct:
        wanted = await _content(request, Cancel)
        with self._room():
            ticket = self.board.ticket()
            self._post(CancelWanted(ticket, wanted.task, wanted.language))
            return await self._answer(ticket)

    async def _tasks(self, request: Request) -> msgspec.Struct:
        return replace(self.board.tasks, held=self._robot.held)

    async def _events(self, request: Request) -> msgspec.Struct:
        query = parse_qs(request.url.query)
        try:
            since = int(query.pop("since", ["0"])[-1])
            wait_s = float(query.pop("wait", ["0"])[-1])
        except ValueError as error:
            raise Refused(400, f"since is a whole number, wait are seconds: {error}") from error
        if not (since >= 0 and 0.0 <= wait_s <= LONGEST_WAIT_S):
            raise Refused(400, f"since is 0 or more, wait is 0 to {LONGEST_WAIT_S:g} s")
        if query:
            raise Refused(400, f"unknown: {', '.join(sorted(query))}; there are since and wait")
        with self._room():
            return await self.board.events(since, wait_s)

    @contextlib.contextmanager
    def _room(self) -> Iterator[None]:
        """Wait among AT_ONCE at most; a stop does not wait, and is never kept out."""
        if self.waiting >= AT_ONCE:
            raise Refused(503, f"{AT_ONCE} requests wait already; try again")
        self.waiting += 1
        try:
            yield
        finally:
            self.waiting -= 1

    async def _answer(self, ticket: str) -> msgspec.Struct:
        answer = await self.board.answer(ticket, ANSWER_S)
        if answer is None:
            raise Refused(503, f"no answer within {ANSWER_S:g} s; look at /tasks")
        if answer.line is None:
            raise Refused(answer.status, answer.problem)
        return answer.line


async def _content(request: Request, kind: type[Any]) -> Any:
    try:
        content = msgspec.json.decode(await whole_body(request), type=kind)
        msgspec.json.encode(content)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        fields = ", ".join(kind.__struct_fields__)
        raise Refused(400, f"not JSON with the field {fields}: {error}") from error
    return content


class HttpDevice:
    """The device of hi: listens at once, and writes its address into the run folder."""

    busy = False

    def __init__(
        self,
        post: Post,
        run_dir: Path,
        listen: tuple[str, int] = LOOPBACK,
        lent: Path | None = None,
    ) -> None:
        """Listen at host and port, 0 for a free one. `lent`: a folder that gets the address, too.
        Raise OSError.
        """
        self._listener = listener(*listen, "ROCO_HTTP")
        self.address = HiAddress(self._listener.getsockname()[1], secrets.token_urlsafe(24))
        self.app = HttpApp(self.address, post, RobotStop(run_dir))
        self._server = Server(self.app)
        self._loop = asyncio.new_event_loop()
        self._files = [folder / HI_FILE for folder in (run_dir, lent) if folder is not None]
        for file in self._files:
            write_secret(file, msgspec.json.encode(self.address))
        self._thread = threading.Thread(target=self._serve, name="http", daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        with contextlib.closing(self._loop), self._listener:
            self._loop.run_until_complete(self._server.serve(sockets=[self._listener]))

    def tell(self, content: Any) -> None:
        """Take a message of the agent for people."""
        if isinstance(content, StopRobot):
            try:
                content = Answer(content.ticket, self.app.hold(True, content.text))
            except Refused as refused:
                content = Answer(content.ticket, problem=str(refused), status=refused.status)
        self._soon(self.app.board.tell, content)

    def close(self) -> None:
        """Stop listening; waiting requests are answered."""
        self._soon(self._end)
        self._thread.join()
        for file in self._files:
            file.unlink(missing_ok=True)

    def _end(self) -> None:
        self.app.board.close()
        self._server.should_exit = True

    def _soon(self, call: Callable[..., None], *arguments: Any) -> None:
        with contextlib.suppress(RuntimeError):  # it has ended
            self._loop.call_soon_threadsafe(call, *arguments)
