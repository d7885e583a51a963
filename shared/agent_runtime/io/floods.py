"""Sums of what one agent was told too much of, and that the disk has its share: said in its log, for people."""

from collections.abc import Mapping

from agent_runtime.io.logs import Log


class Floods:
    """Writer of the log lines about dropped messages and the full step log; it remembers what it has logged."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._dropped: dict[str, int] = {}
        self._full_told = False

    def look(self, dropped: Mapping[str, int], *, full: bool) -> None:
        """Log who says more than is taken (`dropped`: "kind of peer" -> how often so far); `full`: the step log is."""
        for what, count in tuple(dropped.items()):
            new = count - self._dropped.get(what, 0)
            if new:
                self._dropped[what] = count
                kind, _, peer = what.partition(" of ")
                why = "more than a peer may say: what is durable or asked comes again"
                self._log.write("over quota", level="warning", sender=peer, kind=kind, count=new, why=why)
        if full and not self._full_told:
            self._full_told = True
            why = "the step log is full, steps are not logged any more: begin a new run folder to have them"
            self._log.write("disk limit", level="error", why=why)
        self._log.look()
