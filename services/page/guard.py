"""Access check before anything else looks at a request: an ASGI layer around the page.

Host names this machine's loopback (a page of elsewhere reaches the robot by no rebound name), a
POST comes from this page itself (its Origin), and all but the door needs the cookie of a paired
browser. `docs/page.md` says why.
"""

import time
from collections.abc import Callable, Mapping
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from companion.loopback_server import Refused, check_host
from services.page.pairing import Bucket, Pairs, digest_of

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
    """`app` for who is let in. `port`: where the page is; `wall`, `clock`: unix time, and one that
    only grows [s].
    """

    def __init__(
        self,
        app: ASGIApp,
        port: int,
        pairs: Pairs,
        wall: Callable[[], float] = time.time,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app, self._pairs, self._wall, self._clock = app, pairs, wall, clock
        self._port, self._cookie = port, cookie_name(port)
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
            check_host(headers, self._port)
        except Refused as refused:
            return refused.status, str(refused)
        host = headers["host"]
        if scope["method"] == "POST" and path != "/code" and not _same(headers, f"http://{host}"):
            return 403, f"Origin must be http://{host}: only this page may ask for that"
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
