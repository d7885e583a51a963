"""`roco send` over Zenoh: a person in the place of an agent that does not run, and beside one that
does.
"""

from pathlib import Path

import msgspec
import pytest
from secured_fleet import serve, serve_linked
from toy_fleet import Fleet as Processes
from toy_fleet import wait_for
from typer.testing import CliRunner

from companion.tools.verbs.hi import Hi, address
from console.__main__ import app
from console.fleet.local import Local
from console.traffic.send import Sending

pytestmark = pytest.mark.zenoh

LOOK = ("--content", '{"type":"LookAround"}')
COMMAND = ("--as", "hi", "--to", "co", "--protocol", "request", "--performative", "request")


@pytest.fixture
def fleet(secured_router: Processes) -> Processes:
    """A router with keys and co, alone."""
    serve_linked(secured_router, "co")
    return secured_router


def roco(run: Path, *words: str, code: int = 0) -> str:
    """`roco send`; its exit code must be `code`."""
    words = ("send", *words, "--run-dir", str(run))
    done = CliRunner().invoke(app, words, env={"COLUMNS": "100"})
    assert done.exit_code == code, done.output
    return done.stdout + done.stderr


def sent(run: Path, *words: str) -> Sending:
    """The same, for programs."""
    return msgspec.json.decode(roco(run, *words, "--format", "json"), type=Sending)


def test_a_person_is_hi_and_then_hi_is_itself(fleet: Processes) -> None:
    """Two lives of a stand-in number on, and so does hi after them: co takes every number once."""
    first = sent(fleet.run, *COMMAND, *LOOK, "--wait", "2")
    assert (first.sent["id"], first.sent["conversation"], first.receipted) == ("1", "hi-1-1", True)
    assert first.heard[0]["performative"] == "agree"
    assert first.heard[0]["in_reply_to"] == "1"
    second = sent(fleet.run, *COMMAND, *LOOK, "--wait", "2")
    told = second.sent["id"], second.sent["conversation"], second.receipted
    assert told == ("2", "hi-2-2", True)
    mine = [one for one in second.heard if one["conversation"] == "hi-2-2"]
    assert {one["performative"] for one in mine} == {"agree"}
    wait_for(lambda: "hi" not in fleet.beat("co").unreceipted, "co's answers are receipted")
    serve(fleet, "hi")
    fleet.ready("hi")
    assert fleet.beat("hi").incarnation == 3
    hi = Hi(address(Local(fleet.run)))
    task = hi.say("look around").task
    state = lambda: next(line.state for line in hi.tasks() if line.task == task)  # noqa: E731
    fleet.wait(lambda: state() != "asked", "co answered")
    wait_for(lambda: fleet.beat("hi").unreceipted == {}, "co receipted number 3")
    assert not {"gap", "taken before", "stray"} & fleet.beat("co").counts.keys()


def test_beside_an_agent_that_lives_it_refuses(fleet: Processes) -> None:
    """With the reason and what to do; by force it is a voice without a number, and the agent's
    streams stay whole.
    """
    words = [
        "--as",
        "co",
        "--to",
        "pl",
        "--protocol",
        "request",
        "--performative",
        "cancel",
        "--wait",
        "0.2",
    ]
    said = roco(fleet.run, *words, code=1)
    assert "co runs" in said
    assert "--force" in said
    assert "nobody answers" in roco(fleet.run, *words, "--force", code=1), "pl does not run"
    serve_linked(fleet, "pl")
    forced = sent(fleet.run, *words, "--force")
    assert forced.sent["id"].startswith("forced-")
    assert forced.receipted is None
    assert fleet.beat("co").incarnation == 1


def test_what_is_wrong_may_be_said_on_purpose(fleet: Processes) -> None:
    """By force only; co says that it does not understand, and lives."""
    nonsense = (*COMMAND, "--content", '{"type":"Nonsense"}')
    assert "Nonsense" in roco(fleet.run, *nonsense, code=2)
    done = sent(fleet.run, *nonsense, "--force", "--wait", "5")
    assert done.ended
    assert [one["performative"] for one in done.heard] == ["not-understood"]
    assert fleet.processes["co"].poll() is None


def test_nobody_there(fleet: Processes, tmp_path: Path) -> None:
    """Said to an agent that does not run it waits in the journal, and the next life says it again;
    without a router, too.
    """
    fleet.kill("co")
    said = roco(fleet.run, *COMMAND, *LOOK, "--wait", "0.1")
    assert "not receipted by co" in said
    serve(fleet, "co")
    wait_for(lambda: fleet.beat("co").incarnation == 2, "co lives again")
    done = sent(fleet.run, *COMMAND, *LOOK, "--wait", "3")
    assert done.receipted
    agreed = [one["in_reply_to"] for one in done.heard if one["performative"] == "agree"]
    assert agreed == ["1", "2"]
    fleet.kill("router")
    assert sent(fleet.run, *COMMAND, *LOOK, "--wait", "3").receipted, "agents are linked without it"
    assert "no run" in roco(tmp_path / "none", *COMMAND, *LOOK, code=3)
