"""`roco conversation`: listed with filters, drawn as a sequence of arrows, of a run that ended or
goes on.
"""

from itertools import product
from pathlib import Path

import calling
import msgspec
import pytest
from calling import POUR
from rich.cells import cell_len

from companion.design import DESIGN
from console.runs.folders import verdicts_of
from console.terminal import sequence
from console.traffic import trace
from operate.file_names import VERDICTS_FILE
from operate.verdict_lines import Judged
from topdown.judge.verdicts import Verdict

ASKED = Judged(
    t=100.0, verdict=Verdict.LEGAL, bytes=196, channel="C5", sender="ta", receiver="ex",
    protocol="request",
    performative="request", conversation="ta-1-2", id="1", text="look", initiator="asked",
    participant="asked",
)  # fmt: skip
AGREED = msgspec.structs.replace(
    ASKED, t=102.2, sender="ex", receiver="ta", performative="agree", text="accepted",
    initiator="agreed",
    participant="agreed",
)  # fmt: skip
WRONG = msgspec.structs.replace(
    AGREED, t=103.0, verdict=Verdict.OUT_OF_SEQUENCE, violation=True,
    why="request: participant ex says agree in agreed; "
        "it may say failure, inform, inform[progress]",
)  # fmt: skip


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pour, with its verdicts as the monitor writes them."""
    run = tmp_path_factory.mktemp("run")
    (run / VERDICTS_FILE).write_bytes(
        b"".join(msgspec.json.encode(one) + b"\n" for one in verdicts_of(POUR))
    )
    return run


def roco(run_dir: Path, *words: str, columns: int = 80, code: int = 0) -> str:
    """Return the verb's output; its exit code must be `code`."""
    words = ("conversation", *words, "--run-dir", str(run_dir))
    done = calling.roco(*words, columns=columns, code=code)
    return done.stdout + done.stderr


def listed(run_dir: Path, *words: str) -> list[trace.Conversation]:
    """The list, for programs."""
    return msgspec.json.decode(
        roco(run_dir, "--format", "json", *words), type=list[trace.Conversation]
    )


def test_every_conversation_is_listed_once(run_dir: Path) -> None:
    """Each with its agents in their roles, oldest first."""
    found = listed(run_dir)
    assert len({one.id for one in found}) == len(found) == 137
    assert [one.since for one in found] == sorted(one.since for one in found)
    assert {(one.initiator, one.participant) for one in found if one.channel == "C1"} == {
        ("co", "ta")
    }


@pytest.mark.parametrize(
    ("words", "count"),
    [
        (("--channel", "C1"), 2),
        (("--agent", "hi"), 1),
        (("--protocol", "subscribe"), 1),
        (("--open",), 1),
        (("--ended", "--channel", "C5"), 14),
        (("--wrong",), 0),
        (("--channel", "C1", "--channel", "C2"), 3),
        (("--performative", "subscribe", "--performative", "confirm"), 3),
        (("--run", str(POUR / "traffic.mcap"), "--agent", "hi"), 1),
    ],
)
def test_filters(run_dir: Path, words: tuple[str, ...], count: int) -> None:
    """Only what was asked for; the live subscription is the one that goes on."""
    assert len(listed(run_dir, *words)) == count


def test_a_conversation_is_drawn(run_dir: Path) -> None:
    """Both lifelines, each act with its size, its content, the states after it."""
    text = roco(run_dir, "ta-1-2")
    for words in ("request  196 B", "agree  115 B", "inform  1.03 kB", "look", "done"):
        assert words in text, words
    assert (text.count("▶"), text.count("◀")) == (1, 2)


def test_a_drawing_fits_the_terminal(run_dir: Path) -> None:
    """No line is wider, and both lifelines stand in the same columns throughout."""
    found = {one.id: one for one in trace.conversations(verdicts_of(run_dir), DESIGN)}
    for name, width in product(("hi-1-1", "km-1-1", "co-1-2"), (60, 80, 120, 200)):
        one = found[name]
        lines = sequence.drawn(one.said, one.initiator, one.participant, width).plain.splitlines()
        assert max(map(cell_len, lines)) <= width
        columns = [[at for at, letter in enumerate(line) if letter in "│├┤"] for line in lines[1:]]
        assert len({(places[0], places[-1]) for places in columns}) == 1


def test_what_is_wrong_is_marked_with_its_reason() -> None:
    """Verdict and why, under the arrow."""
    text = sequence.drawn((ASKED, AGREED, WRONG), "ta", "ex", 80).plain
    assert "OUT OF SEQUENCE" in text
    assert " ".join(text.split()).count("it may say failure, inform, inform[progress]") == 1
    assert "+3.00 s" in text


def test_an_unknown_conversation_is_said(run_dir: Path) -> None:
    """Exit code 1, and where the known ones are."""
    assert "roco conversation" in roco(run_dir, "nobody-1-1", code=1)


def test_a_run_that_goes_on_is_shown_as_far_as_it_is(tmp_path: Path) -> None:
    """A line that is not whole yet is left out; the conversation goes on."""
    lines = msgspec.json.encode(ASKED) + b"\n" + msgspec.json.encode(AGREED)[:40]
    (tmp_path / VERDICTS_FILE).write_bytes(lines)
    [one] = listed(tmp_path)
    assert (one.ended, one.states) == (False, ("asked", "asked"))
    assert "goes on" in roco(tmp_path, one.id)


def test_the_design_says_who_opened_a_conversation_of_which_the_beginning_is_not_there() -> None:
    """Its first words here are an answer."""
    [one] = trace.conversations([AGREED], DESIGN)
    assert (one.initiator, one.participant) == (ASKED.sender, ASKED.receiver)
