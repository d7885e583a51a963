"""The HTTP service of hi on the loopback interface, as in docs/http.md.

Each request has a thread, which posts a message to the agent and waits for the answer until a deadline; how many there
are before their sender is known. A stop waits for nobody: the thread that reads it sets the flag.
A sentence is read here, too: the agent's step gets its meaning. Must not know: tasks, Zenoh.
"""

import contextlib
import hmac
import http.server
import io
import itertools
import secrets
import socket
import threading
import time
from collections import deque
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import msgspec

from agent_runtime.io.devices import Post
from agent_runtime.io.fleet_processes import set_stop
from agent_runtime.io.run_files import LOOPBACK, STOP_FILE, STOP_HELD, write_secret
from companion.run_files import (
    HELD,
    HI_FILE,
    LET_GO,
    RELEASED,
    SLOTS_FILE,
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
from fipa_codec.communicate import number_of
from services.human_interface import grammar
from services.human_interface.catalogue import can, say
from services.human_interface.grammar import prepare, understand
from services.human_interface.local import Answer, CancelWanted, Halted, Said, Shown, StopRobot, Told

# --- Display of hi for people: tasks, the latest events, answers to tickets. Between the thread of the agent and HTTP's
# Every wait ends. Must not know: HTTP, the agent.


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


# --- Bounds on requests before their sender is known: how many, how long, how large ----------------------------------
# Whoever reaches hi's port can open connections. So that they take neither all threads nor all memory, a request must
# be whole in a given time and size, and of the connections that have not shown the token yet the oldest goes when
# there are too many: a person's request is whole within milliseconds, one that is held open on purpose is old.


MOST_STRANGERS = 32
"""Connections without the token (so far). With as many requests that are served, and some 20 threads of Zenoh, there is
room below the 128 processes and threads of hi's container (deploy/compose.yaml)."""
REQUEST_S = 5.0
"""Longest from a connection's begin to the end of its request; `roco` takes milliseconds (estimate: a busy machine)."""
LONGEST_REQUEST = 81_920
"""Bytes of a request: 16 KiB of head (estimate; `roco` sends 200 bytes), and `server.DRAINED` of body."""
LEAVES_S = 1.0
"""Longest that a connection which was ended keeps the next one waiting (estimate; it takes a millisecond)."""


class Doorstep:
    """The connections that have not shown the token, oldest first; at most `most`."""

    def __init__(self, most: int = MOST_STRANGERS) -> None:
        self._most = most
        self._changed = threading.Condition()
        self._strangers: dict[socket.socket, None] = {}

    def come(self, connection: socket.socket) -> None:
        """Take a new connection; where there are too many, end the oldest and wait until it has left."""
        with self._changed:
            if len(self._strangers) >= self._most:
                with contextlib.suppress(OSError):  # its other side was faster
                    next(iter(self._strangers)).shutdown(socket.SHUT_RDWR)
                self._changed.wait_for(lambda: len(self._strangers) < self._most, LEAVES_S)
            self._strangers[connection] = None

    def leave(self, connection: socket.socket) -> None:
        """Let a connection go that showed the token, or has ended; no matter how often."""
        with self._changed:
            self._strangers.pop(connection, None)
            self._changed.notify_all()


class Bounded(socket.SocketIO):
    """Bounded reader of a connection: for at most REQUEST_S, and at most LONGEST_REQUEST bytes.

    Raise TimeoutError and ConnectionAbortedError beyond.
    """

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(connection, "r")
        self._connection = connection
        self._until = time.monotonic() + REQUEST_S
        self._left = LONGEST_REQUEST

    def readinto(self, buffer: "bytearray | memoryview") -> int | None:  # type: ignore[override]
        """Read what is there, or wait for it until the time is over."""
        left_s = self._until - time.monotonic()
        if left_s <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left_s)
        read = super().readinto(buffer)
        self._left -= read or 0
        if self._left < 0:
            raise ConnectionAbortedError(f"a request of more than {LONGEST_REQUEST} bytes")
        return read


def bounded(connection: socket.socket) -> io.BufferedReader:
    """Return what is read of a connection, bounded in time and size."""
    return io.BufferedReader(Bounded(connection))


# --- The stop flag of the robot, as hi reaches it: a byte in the run folder (docs/run-folder.md), that the loop reads
# No agent, router or key is needed. Where the loop has another run folder, in another container or on another host, the
# flag is out of reach; that is said, and what is next best is done.


OUT_OF_REACH = (
    "I cannot stop the robot from here: its control loop has another run folder. I cancel all tasks instead, and what "
    "is held is put down. Where the robot runs, `roco stop` stops it at once"
)
NOT_HELD_HERE = "I cannot release the robot from here: its loop has another run folder; `roco release` does it there"


class Robot:
    """The robot whose control loop shares this run folder, if one does."""

    def __init__(self, run_dir: Path) -> None:
        self._run = run_dir

    def hold(self, held: bool) -> bool:
        """Stop the robot, or let it go. Return whether its loop reads the flag; raise OSError if it cannot be written.

        Where a supervisor made a flag it is written even if there is no loop yet, which then begins with it.
        """
        if (self._run / STOP_FILE).exists() or self._reached:
            set_stop(self._run, held)
        return self._reached

    @property
    def held(self) -> bool:
        """Whether the robot is stopped, as far as can be told here."""
        try:
            return (self._run / STOP_FILE).read_bytes()[:1] == STOP_HELD
        except OSError:
            return False

    @property
    def _reached(self) -> bool:
        return (self._run / SLOTS_FILE).exists()


# --- The HTTP service of hi on the loopback interface, as in docs/http.md ---------------------------------------------


LONGEST_BODY = 4096
DRAINED = 65536  # bytes of a too long body that are read and dropped, so that its sender reads the answer (estimate)
ANSWER_S = 5.0  # the agent answers in a step, some ms; estimate for a busy machine
LONGEST_WAIT_S = 10.0
WRITTEN_S = 15.0  # longest until an answer is taken (estimate; a client of this machine takes it at once)
AT_ONCE = 32  # requests served at the same time (estimate: some consoles and pages)


class Refused(Exception):
    """A request that is answered by `status` and a sentence."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        self.status, self.text = status, text
        super().__init__(text)


class HttpDevice:
    """The device of hi: listens at once, and writes its address into the run folder."""

    busy = False

    def __init__(self, post: Post, run_dir: Path, listen: tuple[str, int] = LOOPBACK, lent: Path | None = None) -> None:
        """Listen at host and port, 0 for a free one. `lent`: a folder that gets the address, too. Raise OSError."""
        self._board = Board()
        self.address = HiAddress(0, secrets.token_urlsafe(24))
        self._server = _Server(self._board, post, self.address.token, listen, Robot(run_dir))
        self.address = HiAddress(self._server.server_port, self.address.token)
        self._files = [folder / HI_FILE for folder in (run_dir, lent) if folder is not None]
        for file in self._files:
            write_secret(file, msgspec.json.encode(self.address))
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), name="http", daemon=True)
        self._thread.start()
        threading.Thread(target=prepare, name="grammar", daemon=True).start()

    def tell(self, content: Any) -> None:
        """Take a message of the agent for people."""
        if isinstance(content, StopRobot):
            content = self._stopped(content)
        self._board.tell(content)

    def _stopped(self, wanted: StopRobot) -> Answer:
        try:
            return Answer(wanted.ticket, self._server.hold(True, wanted.text))
        except Refused as refused:
            return Answer(wanted.ticket, problem=refused.text, status=refused.status)

    def close(self) -> None:
        """Stop listening; waiting requests are answered."""
        self._board.close()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
        for file in self._files:
            file.unlink(missing_ok=True)


class _Server(http.server.ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False  # threads that wait for a silent connection must not hold the process
    request_queue_size = 128  # connections that wait to be accepted: a burst of them delays nobody's (estimate)

    def __init__(self, board: Board, post: Post, token: str, listen: tuple[str, int], robot: Robot) -> None:
        self.board, self.post, self.token, self.robot = board, post, token, robot
        self.room = threading.Semaphore(AT_ONCE)
        self.doorstep = Doorstep()
        try:
            super().__init__(listen, _Request)
        except OSError as error:
            why = f"{listen[0]}:{listen[1]} cannot be listened at: {error.strerror}; ROCO_HTTP names another address"
            raise OSError(error.errno, why) from error

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread; it is a stranger's until it shows the token."""
        self.doorstep.come(request)
        super().process_request(request, client_address)

    def hold(self, held: bool, said: str = "") -> TaskLine:
        """Stop the robot or let it go, then tell the agent, which nothing waits for. Raise Refused where that fails."""
        try:
            reached = self.robot.hold(held)
        except OSError as error:
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, f"the stop flag cannot be written: {error}") from error
        text = (HELD if held else LET_GO) if reached else (OUT_OF_REACH if held else NOT_HELD_HERE)
        self.post(Halted(held, reached, text))
        if not reached:
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return TaskLine("", STOPPED if held else RELEASED, text, said, time.time())

    def close_request(self, request: Any) -> None:
        """Close a connection, for whatever reason it ends."""
        super().close_request(request)
        self.doorstep.leave(request)


class _Request(http.server.BaseHTTPRequestHandler):
    server: _Server
    connection: socket.socket

    def setup(self) -> None:
        """Read within bounds."""
        super().setup()
        self.rfile = bounded(self.connection)

    def _serve(self) -> None:
        """Check the sender, then the request; answer it."""
        try:
            self._check()
            self.server.doorstep.leave(self.connection)
            said = self._route()
        except Refused as refused:
            self._reply(refused.status, Problem(refused.text))
        else:
            self._reply(HTTPStatus.OK, said)

    do_GET = do_POST = do_PUT = do_DELETE = do_PATCH = do_HEAD = do_OPTIONS = _serve

    def _check(self) -> None:
        port = self.server.server_port
        if self.headers.get("Host") not in (f"127.0.0.1:{port}", f"localhost:{port}"):
            raise Refused(HTTPStatus.FORBIDDEN, f"Host must be 127.0.0.1:{port} or localhost:{port}")
        given = (self.headers.get("Authorization") or "").encode()
        if not hmac.compare_digest(given, f"Bearer {self.server.token}".encode()):
            text = f"wrong or missing token; send `Authorization: Bearer <token>` with that of {HI_FILE}"
            raise Refused(HTTPStatus.UNAUTHORIZED, text)

    def _route(self) -> msgspec.Struct:
        path = urlsplit(self.path).path
        if path not in _ROUTES:
            raise Refused(HTTPStatus.NOT_FOUND, f"there is no {path}; there are {', '.join(_ROUTES)}")
        verb, serve = _ROUTES[path]
        if self.command != verb:
            raise Refused(HTTPStatus.METHOD_NOT_ALLOWED, f"{path} wants {verb}, not {self.command}")
        return serve(self)

    # --- what can be asked --------------------------------------------------------------------------------------------

    def _say(self) -> msgspec.Struct:
        said = self._body(Say)
        text = said.text
        now = time.time()
        if stop_words(text, self.server.board.tasks().answers(said.asker, now)):
            line = self.server.hold(True, text)
            language = calls_for_help(text)
            return msgspec.structs.replace(line, text=say(language, "helped", can(language))) if language else line
        with self._room():
            meaning = understand(text)
            ticket = self.server.board.ticket()
            urgency = max(said.urgency, int(meaning.when.urgent))
            east = time.localtime().tm_gmtoff // 60 if said.east_min is None else said.east_min
            minute_of_day = (now / 60.0 + east) % grammar.DAY
            within_s = said.within_s or grammar.seconds_left(meaning.when, minute_of_day)
            later_s = said.later_s or grammar.seconds_until(meaning.when, minute_of_day)
            held, when = self.server.robot.held, (urgency, within_s, later_s)
            self.server.post(Said(ticket, text, meaning, held, *when, said.instead, said.asker, now, east))
            return self._answer(ticket)

    def _stop(self) -> msgspec.Struct:
        return self._whatever_the_body(True)

    def _release(self) -> msgspec.Struct:
        return self._whatever_the_body(False)

    def _whatever_the_body(self, held: bool) -> msgspec.Struct:
        """Stop first; then take a body, so that its sender reads the answer."""
        try:
            return self.server.hold(held)
        finally:
            with contextlib.suppress(OSError):
                self.rfile.read(min(number_of(self.headers.get("Content-Length", "")) or 0, DRAINED))

    def _cancel(self) -> msgspec.Struct:
        wanted = self._body(Cancel)
        with self._room():
            ticket = self.server.board.ticket()
            self.server.post(CancelWanted(ticket, wanted.task, wanted.language))
            return self._answer(ticket)

    def _tasks(self) -> msgspec.Struct:
        return msgspec.structs.replace(self.server.board.tasks(), held=self.server.robot.held)

    def _events(self) -> msgspec.Struct:
        query = parse_qs(urlsplit(self.path).query)
        try:
            since = int(query.pop("since", ["0"])[-1])
            wait_s = float(query.pop("wait", ["0"])[-1])
        except ValueError as error:
            raise Refused(HTTPStatus.BAD_REQUEST, f"since is a whole number, wait are seconds: {error}") from error
        if not (since >= 0 and 0.0 <= wait_s <= LONGEST_WAIT_S):
            raise Refused(HTTPStatus.BAD_REQUEST, f"since is 0 or more, wait is 0 to {LONGEST_WAIT_S:g} s")
        if query:
            raise Refused(HTTPStatus.BAD_REQUEST, f"unknown: {', '.join(sorted(query))}; there are since and wait")
        with self._room():
            return self.server.board.events(since, wait_s)

    @contextlib.contextmanager
    def _room(self) -> Iterator[None]:
        """Wait among AT_ONCE at most; a stop does not wait, and is never kept out."""
        if not self.server.room.acquire(blocking=False):
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, f"{AT_ONCE} requests wait already; try again")
        try:
            yield
        finally:
            self.server.room.release()

    def _answer(self, ticket: str) -> msgspec.Struct:
        answer = self.server.board.answer(ticket, ANSWER_S)
        if answer is None:
            raise Refused(HTTPStatus.SERVICE_UNAVAILABLE, f"no answer within {ANSWER_S:g} s; look at /tasks")
        if answer.line is None:
            raise Refused(HTTPStatus(answer.status), answer.problem)
        return answer.line

    # --- in and out ---------------------------------------------------------------------------------------------------

    def _body(self, kind: type[Any]) -> Any:
        length = number_of(self.headers.get("Content-Length", ""))
        if length is None:
            raise Refused(HTTPStatus.BAD_REQUEST, "Content-Length must say how long the body is")
        try:
            data = self.rfile.read(min(length, DRAINED))
        except TimeoutError as error:
            text = f"a request must be whole within {REQUEST_S:g} s, this one lacks of its {length} bytes"
            raise Refused(HTTPStatus.REQUEST_TIMEOUT, text) from error
        if length > LONGEST_BODY:
            text = f"the body has {length} bytes, at most {LONGEST_BODY} are taken"
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, text)
        try:
            body = msgspec.json.decode(data, type=kind)
            msgspec.json.encode(body)
        except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
            fields = ", ".join(kind.__struct_fields__)
            raise Refused(HTTPStatus.BAD_REQUEST, f"not JSON with the field {fields}: {error}") from error
        return body

    def _reply(self, status: HTTPStatus, what: msgspec.Struct) -> None:
        data = msgspec.json.encode(what)
        self.connection.settimeout(WRITTEN_S)
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer what is not HTTP with a sentence, too."""
        self._reply(HTTPStatus(code), Problem(message or HTTPStatus(code).phrase))

    def handle(self) -> None:
        """Ignore a client that goes away in the middle of a request."""
        try:
            super().handle()
        except OSError:
            self.close_connection = True

    def log_message(self, *words: object) -> None:
        """Log nothing here: the steps of the agent are logged."""


_ROUTES = {
    "/say": ("POST", _Request._say),
    "/cancel": ("POST", _Request._cancel),
    "/stop": ("POST", _Request._stop),
    "/release": ("POST", _Request._release),
    "/tasks": ("GET", _Request._tasks),
    "/events": ("GET", _Request._events),
}
