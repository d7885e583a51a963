"""`roco traffic judge`: a recording judged for people and for programs, and what cannot be
judged.
"""

from io import StringIO
from pathlib import Path

import msgspec
import pytest
from calling import POUR, printed, roco

from console.terminal.console import Console
from console.traffic import judge
from operate.verdict_lines import Dead, DeadLetter, Judged
from topdown.judge.verdicts import Verdict

LATE = Judged(
    t=105.0, verdict=Verdict.LATE, bytes=300, channel="C4", sender="km", receiver="pl",
    protocol="query",
    performative="inform-ref", conversation="pl-1-1", id="km-1-1", why="2.000 s after the reply-by",
    violation=True,
)  # fmt: skip
FINE = msgspec.structs.replace(
    LATE, t=100.0, verdict=Verdict.LEGAL, id="km-1-0", violation=False, why=""
)
NOISE = Judged(t=106.0, verdict=Verdict.MALFORMED, bytes=7, key="a/b", why="no map", violation=True)


def shown(*lines: Judged, width: int = 80) -> str:
    """Return these verdicts as a person sees them."""
    console = Console(width=width, record=True, file=StringIO())
    judge.show(judge.summary(list(lines)), console)
    return console.export_text()


def test_a_run_as_designed() -> None:
    """Exit code 0, the sentence, and each channel with its count."""
    out = roco("traffic", "judge", str(POUR), code=0).stdout
    assert "nothing against the design; 1 of 424 communicates slow" in out
    assert "legal" in out
    assert "C6" in out


def test_the_same_for_programs() -> None:
    """Counts by channel and verdict; no violation."""
    told = printed("traffic", "judge", POUR / "traffic.mcap")
    assert (told["communicates"], told["violations"]) == (424, [])
    assert told["channels"]["C5"] == {"legal": 42}


def test_what_is_no_recording_is_wrong_usage(tmp_path: Path) -> None:
    """Exit code 2, and what to give instead; in JSON too."""
    words = ("traffic", "judge", tmp_path / "none")
    done = roco(*words, code=2)
    assert (done.stdout, "give a run folder" in done.stderr) == ("", True)
    assert "give a run folder" in printed(*words, code=2)["error"]


def test_violations_are_told_with_place_and_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 1; what, who, where, when since the first communicate, why; also of what was no
    communicate.
    """
    text = shown(FINE, LATE, NOISE)
    assert "late  C4  km > pl inform-ref" in text
    assert "+5.00" in text
    assert "2.000 s after the reply-by" in text
    assert "7 bytes on a/b" in text
    assert "2 violations of the design among 3 communicates" in text
    monkeypatch.setattr(judge, "judged", lambda *_: [FINE, LATE])
    roco("traffic", "judge", "x", code=1)


def test_what_was_not_judged_is_said() -> None:
    """No violation, and yet not all is as designed."""
    text = shown(
        FINE, msgspec.structs.replace(FINE, t=101.0, verdict=Verdict.NOT_JUDGED, id="km-1-9")
    )
    assert "1 of 2 communicates could not be judged" in text


@pytest.mark.parametrize("width", [80, 120])
def test_no_line_is_wider_than_the_terminal(width: int) -> None:
    """With every verdict there is, on as many channels as the design has."""
    lines = [
        msgspec.structs.replace(
            FINE, t=100.0 + n, verdict=verdict, channel=f"C{n % 6 + 1}", violation=n > 3
        )
        for n, verdict in enumerate(Verdict)
    ]
    assert max(len(line) for line in shown(*lines, width=width).splitlines()) <= width


def test_a_flood_of_violations_is_cut() -> None:
    """People see the first ones and how many more there are."""
    flood = [msgspec.structs.replace(LATE, t=100.0 + n, id=str(n)) for n in range(judge.MOST + 5)]
    assert "and 5 more" in shown(*flood)


@pytest.mark.parametrize("width", [80, 120])
def test_the_reason_of_a_dead_letter_is_in_lines_that_can_be_read(width: int) -> None:
    """Also beside the longest names."""
    why = "no stream number: a durable communicate has its stream's number as id"
    letter = DeadLetter(
        100.0, Dead.OVER, why, sender="dispatcher", receiver="traffic", id="dispatcher-117-29",
        protocol="fipa-contract-net", performative="accept-proposal",
    )  # fmt: skip
    console = Console(width=width, record=True, file=StringIO())
    judge.show_letters([letter], console)
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= width
    assert why in " ".join(line.strip() for line in lines)
    assert len(lines) <= 6
