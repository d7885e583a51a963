"""Sequence diagram in characters of the traffic among many agents: a lifeline for each, a line per communicate.

Pure, and line by line, so that it can be drawn as it goes by. Of two agents: operate.cli.terminal.sequence.
"""

from collections.abc import Sequence

from rich.cells import cell_len
from rich.text import Text

from operate.cli.terminal.sequence import TIME, fit, mark, seconds, style_of
from operate.run_folder import Judged

LEAST, MOST = 12, 24
"""Columns from lifeline to lifeline: fewer would cut most performatives, more is hard to follow by eye (estimates)."""
WORDS = 24
"""Columns left for what is said beside the lifelines, where the terminal is wide enough."""


class Lifelines:
    """The columns of a diagram: `agents` from left to right, as wide as `width` allows."""

    def __init__(self, agents: Sequence[str], width: int) -> None:
        gaps = max(1, len(agents) - 1)
        self.gap = max(LEAST, min(MOST, (width - TIME - WORDS) // (gaps + 1)))
        self.at = {name: TIME + 1 + self.gap // 2 + number * self.gap for number, name in enumerate(agents)}
        self.end = max(self.at.values(), default=TIME) + 1
        self.room = max(0, width - self.end - 1)

    def heading(self) -> Text:
        """Return the names of the agents above their lifelines."""
        line = " " * (TIME + 1) + "".join(f"{fit(name, self.gap - 1):^{self.gap}}" for name in self.at)
        return Text(line.rstrip(), "bold", no_wrap=True)

    def row(self, one: Judged, begin: float, room: int) -> Text:
        """Return a communicate: time since `begin`, an arrow from lifeline to lifeline, and as much of what it says as
        `room` columns hold; of a violation the reason below.
        """
        style = style_of(one)
        since = one.t - begin  # below 0 where a verdict came later than that of what followed
        clock = ("+" if since >= 0 else "-") + seconds(abs(since))
        text = Text(no_wrap=True).append(f"{clock:>{TIME}}", "dim")
        arrow = self.arrow(one.sender, one.receiver, one.performative)
        text.append(arrow or self.remark(one), style)
        text.append(fit(f" {' '.join(filter(None, (one.channel, one.text, mark(one))))}", room), style or "italic")
        if one.violation and one.why:
            text.append(f"\n{'':{TIME + 1}}{one.why}", "red")
        return text

    def arrow(self, sender: str, receiver: str, performative: str) -> str:
        """Return the columns behind the time; "" where one of the two has no lifeline."""
        if sender not in self.at or receiver not in self.at or sender == receiver:
            return ""
        cells, (start, tip) = self._lives(), (self.at[sender], self.at[receiver])
        left, right = min(start, tip), max(start, tip)
        for column in range(left + 1, right):
            cells[column] = "┼" if cells[column] == "│" else "─"
        cells[start] = "├" if start < tip else "┤"
        cells[tip + (1 if tip < start else -1)] = "◀" if tip < start else "▶"
        label = fit(f" {performative} ", right - left - 3)
        first = (left + right + 1 - len(label)) // 2
        cells[first : first + len(label)] = label
        return "".join(cells[TIME:])

    def remark(self, one: Judged) -> str:
        """Return the columns behind the time of what is not between two lifelines."""
        who = f"{one.sender} > {one.receiver} {one.performative}" if one.sender else f"{one.bytes} bytes on {one.key}"
        words = fit(f" {who} ", self.end - TIME - 2)
        return f" {words:─^{max(0, self.end - TIME - 1 - cell_len(words) + len(words))}}"

    def _lives(self) -> list[str]:
        cells = [" "] * self.end
        for column in self.at.values():
            cells[column] = "│"
        return cells
