"""`roco trace` and the general part of `roco why`, on recorded runs of two systems."""

import re
from pathlib import Path

import pytest
from calling import HISTORIES, POUR, printed, roco

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
