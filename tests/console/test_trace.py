"""`roco trace` and the general part of `roco why`, on recorded runs of two systems;
`roco conversation`.
"""

import re
from itertools import product
from pathlib import Path

import calling
import msgspec
import pytest
from calling import HISTORIES, POUR, printed, roco
from rich.cells import cell_len

from companion.design import DESIGN
from console.runs.folders import verdicts_of
from console.terminal import sequence
from console.traffic import trace
from operate.file_names import VERDICTS_FILE
from operate.verdict_lines import Judged
from topdown.judge.verdicts import Verdict

LOGGED, DEPOT = (HISTORIES / f"verified_{name}" for name in ("pour_seed_7", "depot"))
EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"


@pytest.fixture
def depot(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the folder of the second system, so that its recordings are read as its own."""
    monkeypatch.chdir(EXAMPLE)


def test_without_a_task_all_that_can_be_traced_is_listed() -> None:
    """Also for programs; a row for each that nobody's communicate caused."""
    lines = roco("trace", "--run", POUR, code=0).stdout.splitlines()
    tasks = ["km-1-1", "ta-1-2", "hi-1-1"]
    assert [line.split()[0] for line in lines] == ["task", *tasks]
    assert [one["task"] for one in printed("trace", "--run", POUR)] == tasks


@pytest.mark.parametrize(
    ("run", "guessed"), [(POUR, True), (POUR / "traffic.mcap", True), (LOGGED, False)]
)
def test_the_tree_of_a_task(run: Path, guessed: bool) -> None:
    """Two plans and two runs of them below the task; what is only known by time is marked, and the
    mark explained.
    """
    out = roco("trace", "hi-1-1", "--run", run, code=0).stdout
    lines = out.splitlines()
    assert lines[1].split()[:4] == ["pour", "into", "jar", "bowl"]
    plans = [line for line in lines if "co > pl" in line or "co > ta" in line]
    assert len(plans) == 4
    assert all(("~" in line) is guessed for line in plans)
    assert any("93 x query" in line for line in lines)
    marked = any("~" in line for line in lines if "by time:" not in line)
    assert ("~ by time: no step log says what caused it" in out) is marked
    assert max(map(len, lines)) <= 100


def test_each_query_has_a_line_of_its_own_where_all_are_wanted() -> None:
    """Else many alike in a row are one."""
    few, all_of_them = (
        roco("trace", "hi-1-1", "--run", POUR, *more).stdout for more in ((), ("--all",))
    )
    assert all_of_them.count("pl >") > 100 > few.count("pl >")


@pytest.mark.usefixtures("depot")
def test_another_system() -> None:
    """An order of the depot: the calls to both robots, one of which refused, and what the other
    asked for.
    """
    done = roco("trace", "desk-1-4", "--run", DEPOT, code=0)
    _code, out, _ = done.exit_code, done.stdout, done.stderr
    out, _error = done.stdout, done.stderr
    assert "refuse" in next(line for line in out.splitlines() if "dispatcher > mule" in line)
    assert len([line for line in out.splitlines() if "ox > traffic" in line]) == 2


@pytest.mark.usefixtures("depot")
def test_why_of_another_system() -> None:
    """The chain that ends with what the robot's own side told, and who was away meanwhile."""
    out = roco("why", "desk-1-4", "--run", DEPOT, code=0).stdout
    assert "dispatcher said inform to desk: delivered crate of parts" in out
    assert "because ox said inform to dispatcher: carried crate of parts" in out
    assert re.search(r"ox was gone for \d+\.\d s", out)


@pytest.mark.parametrize("subject", ["hi-1-1", "hi-1-1/co"])
def test_one_subject_is_meant_alike_by_all(subject: str) -> None:
    """A conversation, or a part of it with one participant; the task that it is."""
    (talk,) = printed("conversation", subject, "--run", POUR)
    assert (talk["id"], talk["participant"]) == ("hi-1-1", "co")
    assert printed("trace", subject, "--run", POUR)["spans"][0]["id"] == "hi-1-1"
    assert printed("why", subject, "--run", POUR)["about"] == "hi-1-1"


def test_a_sentence_names_its_record() -> None:
    """With --records, and for programs always: every sentence of a chain stands somewhere."""
    assert re.search(
        r"\[C2 co > hi inform, id \d+\]", roco("why", "--run", POUR, "--records").stdout
    )
    for passage in printed("why", "--run", POUR)["passages"]:
        assert all(fact["record"] for fact in passage["facts"])


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (
            ("trace", "hi-9-9"),
            "no conversation 'hi-9-9' in this run; `roco trace` lists what can be traced",
        ),
        (
            ("why", "spoon"),
            (
                "'spoon' is no task of this run, nor a thing that the system knew; its tasks are"
                " hi-1-1"
            ),
        ),
    ],
)
def test_what_is_not_there_is_said_with_what_is(words: tuple[str, ...], wanted: str) -> None:
    """On standard error, with a code of its own kind."""
    done = roco(*words, "--run", POUR)
    assert done.exit_code in (1, 2)
    assert (done.stdout, wanted in done.stderr) == ("", True)


@pytest.mark.parametrize("verb", ["trace", "why"])
def test_a_recording_that_is_not_there(verb: str, tmp_path: Path) -> None:
    """It is named, and what would be right."""
    error = roco(verb, "--run", tmp_path / "none", code=2).stderr
    assert "give a run folder, or a recording" in error
    assert "give a run folder" in roco(verb, "--run", tmp_path, code=2).stderr


# --- `roco conversation`: listed with filters, drawn as a sequence of arrows, of a run that ended
# or goes on.


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
        "allowed: failure, inform, inform[progress]",
)  # fmt: skip


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pour, with its verdicts as the monitor writes them."""
    run = tmp_path_factory.mktemp("run")
    (run / VERDICTS_FILE).write_bytes(
        b"".join(msgspec.json.encode(one) + b"\n" for one in verdicts_of(POUR))
    )
    return run


def conversation(run_dir: Path, *words: str, columns: int = 80, code: int = 0) -> str:
    """Return the verb's output; its exit code must be `code`."""
    words = ("conversation", *words, "--run-dir", str(run_dir))
    done = calling.roco(*words, columns=columns, code=code)
    return done.stdout + done.stderr


def listed(run_dir: Path, *words: str) -> list[trace.Conversation]:
    """The list, for programs."""
    return msgspec.json.decode(
        conversation(run_dir, "--format", "json", *words), type=list[trace.Conversation]
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
    text = conversation(run_dir, "ta-1-2")
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
    assert " ".join(text.split()).count("allowed: failure, inform, inform[progress]") == 1
    assert "+3.00 s" in text


def test_an_unknown_conversation_is_said(run_dir: Path) -> None:
    """Exit code 1, and where the known ones are."""
    assert "roco conversation" in conversation(run_dir, "nobody-1-1", code=1)


def test_a_run_that_goes_on_is_shown_as_far_as_it_is(tmp_path: Path) -> None:
    """A line that is not whole yet is left out; the conversation goes on."""
    lines = msgspec.json.encode(ASKED) + b"\n" + msgspec.json.encode(AGREED)[:40]
    (tmp_path / VERDICTS_FILE).write_bytes(lines)
    [one] = listed(tmp_path)
    assert (one.ended, one.states) == (False, ("asked", "asked"))
    assert "goes on" in conversation(tmp_path, one.id)


def test_the_design_says_who_opened_a_conversation_of_which_the_beginning_is_not_there() -> None:
    """Its first words here are an answer."""
    [one] = trace.conversations([AGREED], DESIGN)
    assert (one.initiator, one.participant) == (ASKED.sender, ASKED.receiver)
