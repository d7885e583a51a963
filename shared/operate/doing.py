"""What this process is at, in words, for whoever shows it to a person who waits
(console.progress).

Of the main thread. Must not know: whether anybody looks.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_at: list[str] = []
"""From the whole to its part that is under way."""


@contextmanager
def doing(words: str) -> Iterator[Callable[[str], None]]:
    """Be at this as long as it lasts; gives what renews the words."""
    place = len(_at)
    _at.append(words)

    def renew(words: str) -> None:
        _at[place] = words

    try:
        yield renew
    finally:
        del _at[place:]


def now() -> str:
    """What the process is at; "" where nobody said."""
    return _at[-1] if _at else ""
