"""The HTTP service of hi on the loopback interface, as in docs/http.md.

Each request has a thread, which posts a message to the agent and waits for the answer until a deadline; how many there
are before their sender is known: `doorstep.py`. A stop waits for nobody: the thread that reads it sets the flag.
A sentence is read here, too: the agent's step gets its meaning. Must not know: tasks, Zenoh.
"""

import contextlib
import hmac
import http.server
import secrets
import socket
import threading
import time
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import msgspec

from agent_runtime.io.devices import Post
from agent_runtime.io.run_files import LOOPBACK, write_secret
from companion.run_files import HELD, HI_FILE, LET_GO, RELEASED, STOPPED, Cancel, HiAddress, Problem, Say, TaskLine
from companion.stop_words import calls_for_help, stop_words
from fipa_codec.communicate import number_of
from services.human_interface import doorstep, times
from services.human_interface.board import Board
from services.human_interface.catalogue import can, say
from services.human_interface.grammar import prepare, understand
from services.human_interface.local import Answer, CancelWanted, Halted, Said, StopRobot
from services.human_interface.robot import NOT_HELD_HERE, OUT_OF_REACH, Robot

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
        self.doorstep = doorstep.Doorstep()
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
        self.rfile = doorstep.bounded(self.connection)

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
            minute_of_day = (now / 60.0 + east) % times.DAY
            within_s = said.within_s or times.seconds_left(meaning.when, minute_of_day)
            later_s = said.later_s or times.seconds_until(meaning.when, minute_of_day)
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
            text = f"a request must be whole within {doorstep.REQUEST_S:g} s, this one lacks of its {length} bytes"
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
