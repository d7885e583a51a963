"""The answers of the page (starlette): its files, the stream of what changes, and what a person
does.

Every action is one of hi's (docs/http.md), but for two. The stop: where the robot's loop shares
this run folder its flag is set here first, whatever hi does. "Go on": ta is told to begin the act
that waits. Must not know: Zenoh, threads of others.
"""

import asyncio
import html
import json
import os
import re
import shutil
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from functools import partial
from importlib import resources
from string import Template
from urllib.parse import parse_qs

import anyio.to_thread
import msgspec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import (
    HTMLResponse,
    JSONResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route

from companion import commands
from companion.loopback import Hi, HiError
from companion.loopback_server import Refused, RobotStop, has_token, whole_body
from companion.run_files import MOST_EAST_MIN, Pairing, Say, TaskLine
from companion.sentences import plain
from companion.stop_words import AT_ONCE_S, calls_for_help, may_answer, stop_words
from services.page import view
from services.page.guard import CODE_S, KEPT_S, Pairs, cookie_name
from services.page.robot import RobotWord
from services.page.view import LANGUAGES, say

# --- Server-sent events that tell browsers of changes; the newest wins, so that a slow reader costs
# no memory


BEAT_S = 3.0
"""Between two beats when nothing changes: a browser that misses three says that it has lost the
page (page.js).
"""
MOST = 24
"""Streams; another one ends the oldest (estimate: some browsers with some tabs)."""


class Streams:
    """The newest content of each channel, and who listens. For one event loop."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[int, bytes]] = {}
        self._count = 0
        self._listeners: dict[asyncio.Event, tuple[str, ...]] = {}
        self._ended: set[asyncio.Event] = set()
        self.closed = False

    def tell(self, channel: str, event: str, data: bytes) -> None:
        """Tell all listeners of a channel; `data` has no line ends."""
        if self._newest.get(channel, (0, b""))[1] == (line := sse(event, data)):
            return
        self._count += 1
        self._newest[channel] = (self._count, line)
        self._wake()

    @property
    def listened(self) -> frozenset[str]:
        """The channels that somebody listens to."""
        return frozenset(one for channels in self._listeners.values() for one in channels)

    def close(self) -> None:
        """End all streams with a word, so that browsers come back at once."""
        self.closed = True
        self._wake()

    async def listen(self, *channels: str) -> AsyncIterator[bytes]:
        """Yield what is new, as long as somebody listens."""
        woken, told = asyncio.Event(), dict.fromkeys(channels, 0)
        self._listeners[woken] = channels
        if len(self._listeners) > MOST:
            oldest = next(iter(self._listeners))
            # it ends later: of many that come at once each must end another one
            del self._listeners[oldest]
            self._ended.add(oldest)
            oldest.set()
        try:
            yield b"retry: 1000\n\n"
            yield sse("clock", b"%d" % (1000.0 * time.time()))  # by which pictures are dated
            while not (self.closed or woken in self._ended):
                woken.clear()
                for channel in channels:
                    number, line = self._newest.get(channel, (0, b""))
                    if number > told[channel]:
                        told[channel] = number
                        yield line
                try:
                    async with asyncio.timeout(BEAT_S):
                        await woken.wait()
                except TimeoutError:
                    yield sse("beat", b"")
            yield sse("bye", b"")
        finally:
            self._listeners.pop(woken, None)
            self._ended.discard(woken)

    def _wake(self) -> None:
        for one in self._listeners:
            one.set()


def sse(event: str, data: bytes) -> bytes:
    """Return an event as it is written."""
    return b"event: " + event.encode() + b"\ndata: " + data + b"\n\n"


# --- Sentences as sound, by espeak-ng where it is installed: a WAV file of each. Nothing is kept --


PROGRAM = "espeak-ng"
LONGEST_TEXT = 400
"""Characters; estimate: half a minute."""
MADE_S = 10.0
AT_ONCE = 2
WORDS_A_MINUTE = "140"
"""espeak-ng's own is 175; slower for ears that are old (estimate)."""
_room = asyncio.Semaphore(AT_ONCE)


def available() -> bool:
    """Whether sentences can be spoken here."""
    return shutil.which(PROGRAM) is not None


async def wav(text: str, language: str) -> bytes | None:
    """Return the sound of a text, in a language of the catalogue; None where it cannot be made in
    time.
    """
    async with _room:
        try:
            process = await asyncio.create_subprocess_exec(
                PROGRAM, "-v", language, "-s", WORDS_A_MINUTE, "--stdin", "--stdout",
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.DEVNULL,
            )  # fmt: skip
        except OSError:
            return None
        try:
            async with asyncio.timeout(MADE_S):
                sound, _ = await process.communicate(text[:LONGEST_TEXT].encode(errors="replace"))
        except TimeoutError:
            return None
        finally:
            with suppress(ProcessLookupError):
                process.kill()
        return sound if process.returncode == 0 and sound else None


# --- The answers of the page (starlette) ----------------------------------------------------------


LANGUAGE_COOKIE = "velma-language"
BROWSER = "browser"
"""The field with the name of the browser that sent a form; the page itself fills it in."""
SCHEME = "scheme"
"""Likewise http or https, by which the form came."""
HI_AT_ONCE = 6
"""Requests to hi at the same time, but for a stop's; estimate: hi answers in milliseconds, or
hangs.
"""
MOST_URGENT = 9
CONTACT = "ROCO_CONTACT"
"""The environment variable with whom to call: a name and a number."""
LONGEST_CONTACT = 80  # characters; estimate: two lines on a telephone
STATIC = {
    "page.css": "text/css",
    "page.js": "text/javascript",
    "pair.js": "text/javascript",
    "icon.svg": "image/svg+xml",
}
_FILES = {
    name: resources.files(__package__).joinpath("static", name).read_bytes() for name in STATIC
}


class Page:
    """The page at `port`. `token`: of page.json, which `roco page` has."""

    def __init__(
        self, hi: Hi, stop: RobotStop, word: RobotWord, pairs: Pairs, port: int, token: str
    ) -> None:
        self.streams = Streams()
        self.heard = view.Heard()
        self._hi, self._stop, self._word = hi, stop, word
        self._pairs, self._port, self._token = pairs, port, token
        self._room = anyio.CapacityLimiter(HI_AT_ONCE)
        self._stopping = anyio.CapacityLimiter(HI_AT_ONCE)
        self._kept: set[asyncio.Task[None]] = set()
        self._documents = {
            (name, language): _document(name, language)
            for name in ("index", "pair")
            for language in LANGUAGES
        }

    def app(self) -> Starlette:
        """Return the application."""
        posts = {
            "/say": self._say,
            "/first": self._first,
            "/step": self._step,
            "/cancel": self._cancel,
            "/pair": self._pair,
        }
        held = {"/stop": partial(self._hold, True), "/release": partial(self._hold, False)}
        return Starlette(
            routes=[
                Route("/", self._index),
                Route("/pair", self._door),
                Route("/events", self._events),
                Route("/speech", self._speech),
                Route("/static/{name}", self._static),
                Route("/code", self._code, methods=["POST"]),
                *(
                    Route(path, _answering(act), methods=["POST"])
                    for path, act in (posts | held).items()
                ),
            ]
        )

    # --- what is shown ----------------------------------------------------------------------------

    def hear(self, **news: object) -> None:
        """Take what has changed, and tell all browsers."""
        self.heard = msgspec.structs.replace(self.heard, **news)
        for language in LANGUAGES:
            self.streams.tell(
                language, "view", msgspec.json.encode(view.view(self.heard, language))
            )

    def see(self, name: str, url: str, at: float) -> None:
        """Show a picture, that was true `at` [unix s]; `name`: one of PICTURES, `url`: what is in
        it, "" for the same.
        """
        if url:
            self.streams.tell(name, name, msgspec.json.encode(url))
        told = msgspec.json.encode({"name": name, "at": 1000.0 * at})
        self.streams.tell(_true(name), "true", told)

    def watched(self) -> frozenset[str] | None:
        """Names of the pictures that somebody has large; None: nobody looks."""
        listened = self.streams.listened
        large = frozenset(name for name in view.PICTURES if _large(name) in listened)
        return large if listened else None

    async def _index(self, request: Request) -> Response:
        language = _language(request)
        name = "index" if request.scope["paired"] else "pair"
        answer = HTMLResponse(self._documents[name, language])
        if request.query_params.get("language") == language:
            answer.set_cookie(
                LANGUAGE_COOKIE, language, max_age=int(KEPT_S), httponly=True, samesite="strict"
            )
        return answer

    async def _door(self, request: Request) -> Response:
        return HTMLResponse(self._documents["pair", _language(request)])

    async def _static(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in _FILES:
            return Response(status_code=404)
        return Response(_FILES[name], media_type=STATIC[name])

    async def _events(self, request: Request) -> Response:
        language = request.query_params.get("language", "")
        channel = language if language in LANGUAGES else LANGUAGES[0]
        large = request.query_params.get("large", "")
        channels = [channel, *view.PICTURES, *map(_true, view.PICTURES)]
        channels += [_large(name) for name in view.PICTURES if name == large]
        return StreamingResponse(self.streams.listen(*channels), media_type="text/event-stream")

    async def _speech(self, request: Request) -> Response:
        text, language = request.query_params.get("text", ""), _language(request)
        sound = await wav(text, language) if text else None
        return Response(sound, media_type="audio/wav") if sound else Response(status_code=404)

    # --- what a person does -----------------------------------------------------------------------

    async def _say(self, fields: dict[str, str], language: str) -> Response:
        text = fields.get("text", "").strip()
        if stop_words(text, await self._answers(text, fields[BROWSER])):
            return await self._stop_in_words(text, language)
        said = Say(
            text,
            int("first" in fields),
            asker=fields[BROWSER],
            east_min=_east_min(fields),
            careful="careful" in fields,
        )
        return await self._ask(partial(self._hi.send, said), language)

    async def _answers(self, text: str, browser: str) -> tuple[str, ...]:
        """The answers to what hi has asked in a browser, if the text may be one, and hi says so at
        once.
        """
        if may_answer(text):
            with anyio.move_on_after(AT_ONCE_S), suppress(HiError):
                call = partial(self._hi.answers, browser)
                return await anyio.to_thread.run_sync(
                    call, abandon_on_cancel=True, limiter=self._stopping
                )
        return ()

    async def _stop_in_words(self, text: str, language: str) -> Response:
        """Stop the robot. If the text calls for help and hi answers, the answer lists what can be
        said.
        """
        if not calls_for_help(text):
            return await self._hold(True, {}, language)
        if self._flag(True):
            self.hear(held=True)
        call = partial(
            anyio.to_thread.run_sync, partial(self._hi.send, Say(text)), limiter=self._stopping
        )
        try:
            return await _of_hi(call, language)
        except Refused:
            return await self._hold(True, {}, language)

    async def _first(self, fields: dict[str, str], language: str) -> Response:
        """Ask for a task again, before all others, in place of the one that waits."""
        lines = [one for one in self.heard.tasks if one.state not in view.ENDED]
        line = next((one for one in lines if one.task == fields.get("task")), None)
        if line is None or line.wish is None:
            raise Refused(404, say(language, "passed"))
        urgency = min(MOST_URGENT, 1 + max(one.urgency for one in lines))
        wish = view.in_language(line.wish, language)
        said = Say(wish, urgency, instead=line.task, asker=fields[BROWSER])
        return await self._ask(partial(self._hi.send, said), language)

    async def _step(self, fields: dict[str, str], language: str) -> Response:
        """Let the act begin that waits, if it is the one that this browser shows."""
        at = fields.get("at", "")
        if not at or not any(one.asks == at for one in self.heard.tasks):
            raise Refused(409, say(language, "passed"))
        if not await anyio.to_thread.run_sync(partial(self._word.go, at), limiter=self._room):
            raise Refused(503, say(language, "unreached"))
        return JSONResponse({"state": "running", "text": say(language, "went_on"), "replies": []})

    async def _cancel(self, fields: dict[str, str], language: str) -> Response:
        return await self._ask(partial(self._hi.cancel, fields.get("task", ""), language), language)

    async def _hold(self, held: bool, fields: dict[str, str], language: str) -> Response:
        """Stop the robot, or let it go: by its flag, then hi is told; where the flag is elsewhere,
        by hi.
        """
        told = partial(
            anyio.to_thread.run_sync, partial(self._hi.hold, held), limiter=self._stopping
        )
        if not self._flag(held):
            return await _of_hi(told, language)
        self.hear(held=held)
        task = asyncio.create_task(_quietly(told))
        self._kept.add(task)
        task.add_done_callback(self._kept.discard)
        return JSONResponse({"state": "stopped" if held else "released", "text": "", "replies": []})

    def _flag(self, held: bool) -> bool:
        """Set the flag. Return whether the robot's loop reads it; hi is to be asked where it does
        not.
        """
        try:
            return self._stop.hold(held)
        except OSError:
            return False

    async def _ask(self, call: Callable[[], TaskLine], language: str) -> Response:
        return await _of_hi(partial(anyio.to_thread.run_sync, call, limiter=self._room), language)

    # --- pairing ----------------------------------------------------------------------------------

    async def _pair(self, fields: dict[str, str], language: str) -> Response:
        cookie = self._pairs.pair(fields.get("code", "").strip(), time.time())
        if cookie is None:
            raise Refused(403, say(language, "pair_wrong"))
        answer = JSONResponse({"state": "paired", "text": "", "replies": []})
        answer.set_cookie(
            cookie_name(self._port), cookie, max_age=int(KEPT_S),
            httponly=True, samesite="strict", secure=fields[SCHEME] == "https",
        )  # fmt: skip
        return answer

    async def _code(self, request: Request) -> Response:
        """A new code for who has the token of page.json; a browser has no business here."""
        if "origin" in request.headers or not has_token(request.headers, self._token):
            return JSONResponse(
                {"error": "wrong or missing token; `roco page` has that of page.json"}, 401
            )
        code = Pairing(self._pairs.new_code(time.time()), CODE_S)
        return Response(msgspec.json.encode(code), media_type="application/json")


def _true(name: str) -> str:
    """The channel that tells when a picture was true."""
    return f"{name} true"


def _large(name: str) -> str:
    """The channel of who has a picture large: nothing is told on it."""
    return f"{name} large"


def _document(name: str, language: str) -> str:
    """A page in a language; page.js finds its words in it."""
    words = view.WORDS[language] | {
        "speak_hint": say(language, "speak_hint", commands.example(language))
    }
    text = Template(
        resources.files(__package__).joinpath("static", f"{name}.html").read_text(encoding="utf-8")
    )
    told = json.dumps({**words, "voice": available()}).replace("<", "\\u003c")
    call = os.environ.get(CONTACT, "").strip()[:LONGEST_CONTACT]
    contact = html.escape(say(language, "call", call)) if call else ""
    return text.substitute(words, words=told, contact=contact)


def _language(request: Request) -> str:
    asked = request.query_params.get("language") or request.cookies.get(LANGUAGE_COOKIE, "")
    return (
        asked if asked in LANGUAGES else view.preferred(request.headers.get("accept-language", ""))
    )


def _answering(
    act: Callable[[dict[str, str], str], Awaitable[Response]],
) -> Callable[[Request], Awaitable[Response]]:
    """An action as a route: its form is read within bounds, its refusal is a sentence, and a
    browser without scripts gets the page again.
    """

    async def route(request: Request) -> Response:
        language = _language(request)
        try:
            own = {BROWSER: request.scope["browser"], SCHEME: request.scope["scheme"]}
            answer = await act(await _form(request) | own, language)
        except Refused as refused:
            return JSONResponse({"error": str(refused)}, refused.status, refused.headers)
        if "application/json" in request.headers.get("accept", ""):
            return answer
        back = RedirectResponse("/", 303)
        back.raw_headers += [pair for pair in answer.raw_headers if pair[0] == b"set-cookie"]
        return back

    return route


async def _form(request: Request) -> dict[str, str]:
    """The fields of a form. Raise Refused for one that is too long, or not whole in time."""
    data = await whole_body(request)
    try:
        fields = parse_qs(data.decode(), keep_blank_values=True, max_num_fields=8)
    except (UnicodeDecodeError, ValueError) as error:
        raise Refused(400, f"not a form in UTF-8: {error}") from None
    return {name: values[-1] for name, values in fields.items()}


def _east_min(fields: dict[str, str]) -> int | None:
    """How far a browser's clock is ahead of UTC [min]; one without scripts does not say so."""
    east = re.fullmatch(r"-?\d{1,4}", fields.get("east_min", ""))
    return int(east[0]) if east and abs(int(east[0])) <= MOST_EAST_MIN else None


async def _of_hi(call: Callable[[], Awaitable[TaskLine]], language: str) -> Response:
    """Return hi's answer. Raise Refused with the sentence of hi's error, or that nothing reached
    it.
    """
    try:
        line = await call()
    except HiError as error:
        status, text = error.status, str(error) if error.status else say(language, "unreached")
        raise Refused(status if status >= 400 else 503, text) from error
    return JSONResponse(
        {"task": line.task, "state": line.state, "text": plain(line.text), "replies": line.replies}
    )


async def _quietly(call: Callable[[], Awaitable[object]]) -> None:
    """Tell hi something that has been done already."""
    try:
        await call()
    except HiError:
        return
