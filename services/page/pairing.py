"""Pairing of browsers with the page: a code pairs one browser, once; afterwards its cookie is
known. No clock, no HTTP.

Six digits are enough as five wrong ones end a code: one guess in 200,000 is right. Only digests of
cookies are kept, in a file, so that a browser stays paired when the page restarts.
"""

import hashlib
import hmac
import secrets
from pathlib import Path

import msgspec

from agent_runtime.io.run_files import write_secret

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
