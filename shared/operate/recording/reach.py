"""Whether a system can be heard: between two routers the way may break while the recorder keeps its own.

Then the tokens of all its agents vanish at once, as if all had died; but who died comes back as a new incarnation, and
who was only out of reach as the same. Pure: records in, a hole out. Must not know: the network, files.
"""

from operate.recording.records import Record, Resumed, Token


class Reach:
    """The tokens of one system that are there, and those that vanished."""

    def __init__(self) -> None:
        self._there: set[tuple[str, int, str]] = set()
        self._away: set[tuple[str, int, str]] = set()
        self._heard = self._since = 0.0

    @property
    def lost(self) -> bool:
        """Whether agents were there, and none is now."""
        return bool(self._away) and not self._there

    def hole(self, record: Record) -> Resumed | None:
        """The time in which nothing could be heard, where this record ends one: a token is back as it was."""
        match record:
            case Token(alive=True):
                return self._came(record)
            case Token():
                self._went(record)
            case Resumed(sender=""):  # told already: the recorder itself was away
                self._there.clear()
                self._away.clear()
            case _:
                self._heard = record.received
        return None

    def _came(self, token: Token) -> Resumed | None:
        name = token.agent, token.incarnation, token.journal
        same, lost = name in self._away, self.lost
        self._there.add(name)
        self._away = self._away - {name} if same or not lost else set()
        return Resumed(self._since, token.received) if same and lost else None

    def _went(self, token: Token) -> None:
        name = token.agent, token.incarnation, token.journal
        self._there.discard(name)
        self._away.add(name)
        if not self._there:
            self._since = min(self._heard or token.received, token.received)
