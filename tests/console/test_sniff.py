"""`roco sniff`: every communicate is an arrow between the right lifelines, in the terminal and in
the drawing.
"""

import re
from itertools import cycle
from pathlib import Path

import calling
import msgspec
import pytest
from calling import POUR
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from companion.design import DESIGN
from console.terminal.sequence import LEAST, Lifelines
from console.traffic.echo import arrows, speakers
from operate.filters import Filter
from operate.verdict_lines import Judged
from topdown.draw.sequence import Arrow, Columns, Diagram, draw
from topdown.judge.verdicts import Verdict

AGENTS = tuple(DESIGN.agents)
ASKED = Judged(
    t=100.0, verdict=Verdict.LEGAL, bytes=196, channel="C5", sender="ta", receiver="ex",
    protocol="request",
    performative="request", conversation="ta-1-2", id="1", text="look",
)  # fmt: skip
WRONG = msgspec.structs.replace(
    ASKED,
    t=101.0,
    verdict=Verdict.OUT_OF_SEQUENCE,
    violation=True,
    why="allowed in done: nothing",
)


def roco(*words: str, columns: int = 120, code: int = 0) -> str:
    """Return the output of `roco sniff` for the pour; its exit code must be `code`."""
    return calling.roco("sniff", "--run", POUR, *words, columns=columns, code=code).output


@given(
    st.sampled_from(AGENTS),
    st.sampled_from(AGENTS),
    st.integers(12, 60),
    st.sampled_from(["agree", "accept-proposal"]),
)
def test_an_arrow_goes_from_the_sender_to_the_receiver(
    one: str, other: str, gap: int, act: str
) -> None:
    """At any width: it begins at the one's lifeline, its head is beside the other's, the others go
    on.
    """
    columns = Columns(AGENTS, gap)
    cells = columns.arrow(one, other, act)
    if one == other:
        assert not cells
        return
    low, high = sorted((columns.at[one], columns.at[other]))
    forth = columns.at[one] == low
    assert cells[columns.at[one]] == ("├" if forth else "┤")
    assert cells[columns.at[other] + (-1 if forth else 1)] == ("▶" if forth else "◀")
    assert cells[columns.at[other]] == "│"
    assert (cells.count("▶"), cells.count("◀")) == ((1, 0) if forth else (0, 1))
    outside = [at for at in columns.at.values() if not low <= at <= high]
    assert [cells[at] for at in outside] == ["│"] * len(outside)
    assert cells[low:high].count(" ") <= 2  # around the act
    assert not [at for at in columns.at.values() if low < at < high and cells[at] == "─"]
    assert len(cells) == columns.width
    assert act[:4] in cells


@given(st.integers(130, 300), st.text(max_size=200))
def test_a_line_fits_into_the_terminal(width: int, text: str) -> None:
    """However long what is said."""
    lives = Lifelines(AGENTS, width)
    row = lives.row(msgspec.structs.replace(ASKED, text=" ".join(text.split())), 100.0, lives.room)
    assert cell_len(row.plain) <= width
    assert lives.gap >= LEAST


def test_names_stand_above_their_lifelines() -> None:
    """In the order of the design."""
    lives = Lifelines(AGENTS, 100)
    heading = lives.heading().plain
    assert heading.split() == list(AGENTS)
    for name, at in lives.columns.at.items():
        assert abs(heading.index(name) + len(name) / 2 - lives.first - at) <= 1


def test_what_has_no_lifeline_is_a_remark() -> None:
    """Garbage, and agents that the design does not have, are shown all the same."""
    lives = Lifelines(AGENTS, 100)
    garbage = Judged(
        t=100.0, verdict=Verdict.MALFORMED, bytes=7, key="roco/x", why="no map", violation=True
    )
    assert "7 bytes on roco/x" in lives.row(garbage, 100.0, 80).plain
    stranger = msgspec.structs.replace(ASKED, sender="zz")
    assert "zz > ex request" in lives.row(stranger, 100.0, 80).plain


def test_what_is_not_as_designed_is_told_in_words() -> None:
    """Verdict beside the arrow, reason below; in the drawing, too."""
    shown = Lifelines(AGENTS, 120).row(WRONG, 100.0, 60).plain
    assert "OUT OF SEQUENCE" in shown
    assert shown.endswith("\n          allowed in done: nothing")
    drawn = draw(Diagram("", AGENTS, tuple(arrows([ASKED, WRONG])))).svg()
    assert "OUT OF SEQUENCE: allowed in done: nothing" in drawn


def test_time_is_since_the_first_line_also_backwards() -> None:
    """A verdict that had to wait comes behind those of what followed."""
    lives = Lifelines(AGENTS, 120)
    assert lives.row(ASKED, 99.5, 0).plain.startswith("  +500 ms")
    assert lives.row(ASKED, 100.5, 0).plain.startswith("  -500 ms")


@pytest.mark.parametrize(
    ("which", "names"),
    [
        (Filter(), AGENTS),
        (Filter(channels=("C4",)), ("pl", "km")),
        (Filter(agents=("hi",)), ("co", "hi")),
        (Filter(protocols=("subscribe",)), ("km", "ta", "ex")),
    ],
)
def test_lifelines_are_of_those_that_may_speak(which: Filter, names: tuple[str, ...]) -> None:
    """By the design, so that they stand before anything was said."""
    assert speakers(DESIGN, which) == list(names)


@pytest.mark.process
def test_a_recording_is_drawn_whole(tmp_path: Path) -> None:
    """An arrow for each communicate that is meant, in the terminal as in the drawing, with what it
    says.
    """
    file = tmp_path / "talk.svg"
    said = roco("--channel", "C2", "--svg", str(file))
    heads = re.findall("[▶◀]", said)
    drawn = file.read_text()
    assert len(heads) == 22 == drawn.count("<polygon")
    assert said.splitlines()[0].split() == ["co", "hi"]
    assert "C2 pour into jar bowl" in said
    assert "pour into jar bowl" in drawn
    assert f"wrote {file}: 22 of 22 arrows" in said


@pytest.mark.process
def test_for_programs_it_is_the_lines_of_traffic_echo() -> None:
    """The same objects, so that there is one form to read."""
    words = ["--run", str(POUR), "--channel", "C2", "--count", "5", "--format", "json"]
    echoed = calling.roco("traffic", "echo", *words).output
    assert calling.roco("sniff", *words).output == echoed
    assert len(echoed.splitlines()) == 5


def test_a_drawing_that_cannot_be_written_is_refused_at_once(tmp_path: Path) -> None:
    """Before anything is heard that would be lost."""
    assert "is not a folder" in roco("--svg", str(tmp_path / "none" / "talk.svg"), code=2)


def test_of_the_drawing_no_label_lies_on_another() -> None:
    """Neither in a row nor between rows."""
    agent, words = cycle(AGENTS).__next__, ("accept-proposal", "C5 200 B and more" * 3)
    pairs = [(agent(), AGENTS[(n + 1 + n % 4) % len(AGENTS)]) for n in range(40)]
    said = tuple(Arrow(*pair, *words, at=0.1 * n) for n, pair in enumerate(pairs))
    labels = draw(Diagram("", AGENTS, said)).labels
    assert len(labels) == len(AGENTS) + 3 * 40
    met = [(a, b) for n, a in enumerate(labels) for b in labels[:n] if a.meets(b)]
    assert met == []
