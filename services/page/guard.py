"""Access check before anything else looks at a request: an ASGI layer around the page.

Host names this machine's loopback, or where tablets reach it (a page of elsewhere reaches the robot
by no rebound name), a POST comes from this page itself (its Origin), and all but the door needs the
cookie of a paired browser. `docs/page.md` says why. A code pairs one browser, once; afterwards its
cookie is known.
"""

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path

import msgspec
from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from agent_runtime.io.run_files import write_secret
from companion.loopback_server import Refused, check_host, loopback_hosts

# --- Pairing of browsers with the page. No clock, no HTTP -----------------------------------------
# Six digits are enough as five wrong ones end a code: one guess in 200,000 is right. Only digests
# of cookies are kept, in a file, so that a browser stays paired when the page restarts.

CODE_S = 300.0
"""Life of a code [s]; estimate: to walk to another room."""
TRIES = 5
KEPT_S = 30 * 86_400.0
"""Time that a browser stays paired [s] (estimate); the run folder, where this is kept, seldom lives
as long.
"""
MOST = 32
"""Paired browsers; another one ends the oldest (estimate: a household has some)."""


class Paired(msgspec.Struct, frozen=True):
    """A browser: SHA-256 of its cookie, and until when it is known [unix s]."""

    digest: str
    until: float


class Code(msgspec.Struct, frozen=True):
    """A code that was given out: until when it can be used [unix s], and how many tries are
    left.
    """

    digits: str
    until: float
    tries: int = TRIES


class Pairs:
    """The code that can be used now, if one can, and the paired browsers, which `file` keeps."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._code: Code | None = None
        self._paired = _read(file)

    def new_code(self, now: float) -> str:
        """Return a code; the one before it can be used no more."""
        self._code = Code(f"{secrets.randbelow(1_000_000):06d}", now + CODE_S)
        return self._code.digits

    def pair(self, digits: str, now: float) -> str | None:
        """Return the cookie of a newly paired browser; None for a code that is wrong, used, or too
        old. Raise OSError.

        A wrong one costs the code that can be used a try.
        """
        code, self._code = self._code, None
        if code is None or now > code.until:
            return None
        if not hmac.compare_digest(digits.encode(), code.digits.encode()):
            left = msgspec.structs.replace(code, tries=code.tries - 1)
            self._code = left if left.tries else None
            return None
        cookie = secrets.token_urlsafe(32)
        self._paired = (*self._paired, Paired(digest_of(cookie), now + KEPT_S))[-MOST:]
        write_secret(self._file, msgspec.json.encode(self._paired))
        return cookie

    def known(self, cookie: str, now: float) -> bool:
        """Whether this cookie is of a paired browser."""
        digest = digest_of(cookie)
        valid = (one for one in self._paired if now < one.until)
        return any(hmac.compare_digest(one.digest, digest) for one in valid)


class Bucket:
    """A bound on how often: `burst` at once, then `per_s`."""

    def __init__(self, burst: float, per_s: float) -> None:
        self._burst, self._per_s = burst, per_s
        self._left, self._at = burst, 0.0

    def take(self, now: float) -> bool:
        """Whether one more is within the bound; then it counts [now: s, of any clock that only
        grows].
        """
        self._left = min(self._burst, self._left + max(0.0, now - self._at) * self._per_s)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def digest_of(cookie: str) -> str:
    """Return what is kept of a cookie; it names the browser to hi, too."""
    return hashlib.sha256(cookie.encode(errors="replace")).hexdigest()


def _read(file: Path) -> tuple[Paired, ...]:
    try:
        return msgspec.json.decode(file.read_bytes(), type=tuple[Paired, ...])
    except (OSError, msgspec.DecodeError):
        return ()


# --- The check of each request --------------------------------------------------------------------

OPEN_TO_ALL = ("/", "/pair", "/code", "/static/page.css", "/static/pair.js", "/static/icon.svg")
"""The door: it shows nothing of the robot. /code wants the token of page.json instead of a
cookie.
"""
BURST, PER_S = 12.0, 2.0
"""Requests of a browser: at once, then per second (estimate: a person clicks less). A stop is not
counted.
"""
PAIR_BURST, PAIR_PER_S = 6.0, 0.5
"""Tries of codes, of all who are not paired together."""
HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; media-src"
        " 'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "referrer-policy": "same-origin",  # no-referrer would make the Origin of forms "null"
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(self)",
    "cache-control": "no-store",
}


class Guard:
    """`app` for who is let in. `port`: of the page on loopback; `tablet`: host:port of the listener
    with TLS that this one guards; `wall`, `clock`: unix time, and one that only grows [s].
    """

    def __init__(
        self,
        app: ASGIApp,
        port: int,
        pairs: Pairs,
        tablet: str = "",
        wall: Callable[[], float] = time.time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app, self._pairs, self._wall, self._clock = app, pairs, wall, clock
        self._cookie = cookie_name(port)
        self._hosts = (tablet,) if tablet else loopback_hosts(port)
        self._scheme, self._codes = ("https", False) if tablet else ("http", True)
        self._buckets: dict[str, Bucket] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it with a sentence."""
        if scope["type"] != "http":
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_HEADERS]
            await send(message)

        refusal = self._refusal(scope)
        app = self._app if refusal is None else PlainTextResponse(f"{refusal[1]}\n", refusal[0])
        await app(scope, receive, guarded)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Status and sentence, where the request is not to be served."""
        headers, path = Headers(scope=scope), scope["path"]
        if "websocket" in headers.get("upgrade", "").lower():
            return 400, "the page has no WebSocket; what it tells comes at /events"
        try:
            check_host(headers, self._hosts)
        except Refused as refused:
            return refused.status, str(refused)
        origin = f"{self._scheme}://{headers['host']}"
        if path == "/code" and not self._codes:
            return 403, "`roco page` makes codes, on the robot's machine"
        if scope["method"] == "POST" and path != "/code" and not _same(headers, origin):
            return 403, f"Origin must be {origin}: only this page may ask for that"
        if path not in OPEN_TO_ALL and headers.get("sec-fetch-site", "none") not in (
            "same-origin",
            "none",
        ):
            return 403, "this is for the page alone, not for another site"
        cookie = cookie_of(headers, self._cookie)
        scope["paired"] = bool(cookie) and self._pairs.known(cookie, self._wall())
        scope["browser"] = digest_of(cookie)[:16] if scope["paired"] else ""
        if path not in OPEN_TO_ALL and not scope["paired"]:
            return 401, "this browser is not paired; `roco page` prints an address that pairs it"
        return self._too_often(scope["method"], path, cookie if scope["paired"] else "")

    def _too_often(self, method: str, path: str, cookie: str) -> tuple[int, str] | None:
        bounded = path == "/speech" if method != "POST" else path != "/stop"
        if not bounded or path == "/code":
            return None
        usual = Bucket(BURST, PER_S) if cookie else Bucket(PAIR_BURST, PAIR_PER_S)
        if self._buckets.setdefault(cookie, usual).take(self._clock()):
            return None
        return 429, "too many requests; wait a moment"


def cookie_name(port: int) -> str:
    """Return the name of the cookie: browsers tell hosts apart, not ports."""
    return f"velma-{port}"


def cookie_of(headers: Mapping[str, str], name: str) -> str:
    """Return the value of a cookie, "" where there is none."""
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return found.value if found is not None else ""


def _same(headers: Headers, origin: str) -> bool:
    """Whether a POST comes from this origin. Sec-Fetch-Site may only add a doubt: not every request
    has it.
    """
    site = headers.get("sec-fetch-site", "same-origin")
    return headers.getlist("origin") == [origin] and site == "same-origin"


_HEADERS = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
