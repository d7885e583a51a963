"""A conversation as a sequence diagram of characters: two lifelines, an arrow for each communicate, states beside them.

Pure: lines in, text out, as wide as it is told.
"""

from collections.abc import Iterable

from rich.cells import cell_len, set_cell_size
from rich.text import Text

from operate.run_folder import Judged
from topdown.judge.verdicts import Verdict

TIME = 9
"""Columns of the time."""
LEAST, MOST = 24, 64
"""Columns between the lifelines: fewer would not hold a performative with its size, more is hard to follow by eye."""
STATES = 20
"""Columns of each side's state, where there is room."""
QUIET = {Verdict.LEGAL: "", Verdict.COPY: "dim", Verdict.SLOW: "yellow", Verdict.NOT_JUDGED: "dim"}
MARKS = {Verdict.COPY: "copy", Verdict.SLOW: "slow", Verdict.NOT_JUDGED: "not judged"}


def heading(channel: str, protocol: str, conversation: str, states: tuple[str, str], ended: bool) -> Text:
    """Return the heading: channel, protocol, conversation and both states."""
    text = Text.assemble((conversation, "bold"), f"  {protocol} on {channel}  ")
    return text.append("ended" if ended else "goes on", "dim" if ended else "cyan")


def drawn(said: Iterable[Judged], initiator: str, participant: str, width: int) -> Text:
    """The diagram. Above an arrow the act and its size, below it what it says; why, where it is not as designed."""
    said = tuple(said)
    side = max([4, *map(cell_len, (initiator, participant)), *(cell_len(one.initiator) for one in said)])
    side = min(STATES, side)
    gap = max(LEAST, min(MOST, width - TIME - 2 * side - 6))
    diagram = Text(no_wrap=True)
    diagram.append(f"{'':{TIME}} {initiator:>{side}} ", "bold").append(f"{'':{gap + 2}}").append(
        f" {participant}\n", "bold"
    )
    for one in said:
        diagram.append_text(_step(one, said[0].t, initiator, side, gap, width))
    return diagram


def seconds(span: float) -> str:
    """A span of time in few characters."""
    if span < 0.9995:
        return f"{1000 * span:.0f} ms"
    return f"{span:.2f} s" if span < 100 else f"{span:.0f} s"


def style_of(one: Judged) -> str:
    """Return the style of what the judge says of a communicate; "" where there is nothing to say."""
    return "red" if one.violation else QUIET.get(Verdict(one.verdict), "")


def mark(one: Judged) -> str:
    """Return the verdict in a word, where it is not simply legal."""
    return one.verdict.upper() if one.violation else MARKS.get(Verdict(one.verdict), "")


def fit(words: str, room: int) -> str:
    """As much of it as there is room for."""
    return words if cell_len(words) <= room else set_cell_size(words, max(0, room - 1)) + "…" * (room > 0)


def _step(one: Judged, begin: float, initiator: str, side: int, gap: int, width: int) -> Text:
    """The lines of one communicate."""
    style = style_of(one)
    forth = one.sender == initiator
    margin, blank = " " * (TIME + 1), " " * side
    label = fit(f"{one.performative}  {_size(one.bytes)}", gap)
    left, right = (fit(one.initiator, side).rjust(side), one.participant) if one.initiator else (blank, "")
    text = Text(no_wrap=True)
    text.append(f"{'+' + seconds(one.t - begin):>{TIME}} ", "dim").append(blank).append(f" │{label:^{gap}}│\n", style)
    arrow = "─" * (gap - 1)
    text.append(margin).append(left, "dim").append(f" │{arrow + '▶' if forth else '◀' + arrow}│ ", style)
    text.append(f"{fit(right, max(0, width - TIME - side - gap - 6))}\n", "dim")
    for words in (one.text, mark(one)):
        if words:
            text.append(f"{margin}{blank} │").append(f"{fit(words, gap):^{gap}}", style or "italic").append("│\n")
    if one.violation and one.why:
        text.append_text(_reason(one.why, len(margin) + side + 3, width))
    return text


def _reason(why: str, indent: int, width: int) -> Text:
    """Return the reason, wrapped below its line."""
    text, line = Text(no_wrap=True), ""
    for word in why.split():
        if line and cell_len(line) + 1 + cell_len(word) > max(20, width - indent):
            text.append(" " * indent + line + "\n", "red")
            line = ""
        line = f"{line} {word}".strip()
    return text.append(" " * indent + line + "\n", "red")


def _size(count: int) -> str:
    return f"{count} B" if count < 1000 else f"{count / 1000:.3g} kB"
