"""Sequence diagram of the messages among any number of agents: a lifeline each, one arrow below the other.

Of the two roles of a protocol, with what may be said: topdown.draw.sequence.
"""

from collections.abc import Sequence

import msgspec

from topdown.draw.canvas import Box, Canvas, width_of

LEAST = 120.0
"""Least distance of two lifelines [px]."""
HEAD, ROW, DETAIL = 30.0, 30.0, 14.0
"""Heights of the boxes with names, of an arrow, and of the line below it [px]."""
TIME = 64.0
"""Width of the times at the left [px]."""
MOST = 48
"""Letters of a detail; more would be wider than the arrow of most (estimate)."""


class Arrow(msgspec.Struct, frozen=True):
    """Something that was said `at` seconds after the first: `label` above its arrow, `detail` below.

    `alert`: in words what is wrong with it. Where `sender` or `receiver` has no lifeline it is a remark.
    """

    at: float
    sender: str
    receiver: str
    label: str
    detail: str = ""
    alert: str = ""


def draw(agents: Sequence[str], arrows: Sequence[Arrow], title: str) -> Canvas:
    """Return the diagram as a drawing, its lifelines in the order of `agents`."""
    canvas, under = Canvas(title), Canvas(title)
    gap = max([LEAST, *(_width(one) + 24 for one in arrows), *(width_of(name, "strong large") + 34 for name in agents)])
    at = {name: TIME + gap / 2 + number * gap for number, name in enumerate(agents)}
    y = HEAD + 10
    for one in arrows:
        y = _row(canvas, one, at, y)
    for name, x in at.items():
        under.line([(x, HEAD), (x, y + 16)], "life")
        half = width_of(name, "strong large") / 2 + 14
        under.box(Box(x - half, 0, 2 * half, HEAD), "box")
        under.words((x, 20), name, "strong large", "middle")
    canvas.put_under(under)
    return canvas


def _row(canvas: Canvas, one: Arrow, at: dict[str, float], y: float) -> float:
    """Draw an arrow below `y`; where the next one begins."""
    y += ROW
    between = one.sender in at and one.receiver in at and one.sender != one.receiver
    ends = (at[one.sender], at[one.receiver]) if between else (min(at.values(), default=TIME),) * 2
    middle = (ends[0] + ends[1]) / 2
    canvas.words((TIME - 12, y), f"+{one.at:.2f} s", "small quiet", "end")
    label = one.label if between else f"{one.sender} > {one.receiver} {one.label}"
    canvas.patched((middle, y - 6), label, "strong", "middle" if between else "start")
    if between:
        canvas.arrow([(ends[0], y), (ends[1], y)])
    for words, css in ((_short(one.detail), "small quiet"), (one.alert, "small alert")):
        if words:
            y += DETAIL
            canvas.patched((middle, y), words, css, "middle" if between else "start")
    return y


def _width(one: Arrow) -> float:
    """Return the width of what stands at an arrow [px]; a long alert may cross its neighbours."""
    return max(width_of(one.label, "strong"), width_of(_short(one.detail), "small"))


def _short(words: str) -> str:
    return words if len(words) <= MOST else words[: MOST - 1] + "…"
