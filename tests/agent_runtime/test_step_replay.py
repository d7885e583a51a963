"""An agent run again from its log: the same bytes, or the first step that puts out something
else.
"""

from pathlib import Path
from typing import Any

import msgspec
import pytest
from driven import Seen, logged, recording, request
from msgspec.structs import replace
from toy_agents import Want, single, wirings

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Local, PeerChanged, Started
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.io import cli, shell
from agent_runtime.io.steplog import HEAD, Again, again, digest, fingerprint, read
from fipa_codec.performatives import Performative as P

_, TO_ASKER = wirings()
LIVES = (
    (Started(), PeerChanged("asker", 1), request(1), Local(Want(1))),
    (Started(first=False), Local(Want(2))),
)
"""Inputs of two lives of an agent, the second one from the first one's last record."""


def answering(turn: Turn) -> None:
    """Refuse every request."""
    if getattr(turn.event, "talk", None) is not None:
        turn.say(turn.event.conversation, P.REFUSE)


def rerun(agent: Agent[Any], path: Path) -> Again:
    """Run a log again."""
    return again(Core(agent, TO_ASKER), path)


def rewritten(path: Path, left_out: int) -> None:
    """Leave a line of a log out."""
    lines = [msgspec.msgpack.encode(one) for one in read(path)]
    del lines[left_out]
    path.write_bytes(b"".join(HEAD.pack(len(line)) + line for line in lines))


def test_all_lives_put_out_the_same(tmp_path: Path) -> None:
    """With every communicate, by its digest, and the step that put it out."""
    said = logged(tmp_path / "a.steps", recording(said=answering), LIVES)
    found = rerun(recording(said=answering), tmp_path / "a.steps")
    assert (found.lives, found.steps, found.parted) == (2, 6, None)
    assert [one.digest for one in found.said] == [digest(wire) for wire in said]
    first = found.said[0]
    assert (first.incarnation, first.step, first.receiver) == (1, 3, "asker")


def test_the_first_step_that_differs_is_named(tmp_path: Path) -> None:
    """With the record before it, and what it puts out now."""
    logged(tmp_path / "a.steps", recording(said=answering), LIVES)
    parted = rerun(recording(), tmp_path / "a.steps").parted
    assert parted is not None
    assert (parted.incarnation, parted.step, parted.kind) == (1, 3, "Arrived")
    assert parted.now is not None
    assert parted.now.sends == ()
    assert parted.deed is not None
    assert parted.deed.said != parted.now.deed.said
    assert msgspec.msgpack.decode(parted.before)["memory"] == {"seen": ["Started", "PeerChanged"]}


def test_a_difference_of_a_later_life_is_found(tmp_path: Path) -> None:
    """The life begins with the record in the log, not with what the life before it left."""

    def twice(memory: Seen, turn: Turn) -> Seen:
        more = 2 if turn.event == Local(Want(2)) else 1
        return Seen(memory.seen + (type(turn.event).__name__,) * more)

    logged(tmp_path / "a.steps", recording(), LIVES)
    found = rerun(single("server", Seen(), twice, local=Want), tmp_path / "a.steps")
    assert found.parted is not None
    assert (found.steps, found.lives, found.parted.incarnation, found.parted.step) == (5, 2, 2, 2)


def test_an_agent_that_fails_now_is_a_difference(tmp_path: Path) -> None:
    """With its words."""

    def failing(turn: Turn) -> None:
        raise RuntimeError("no more ideas")

    logged(tmp_path / "a.steps", recording(), LIVES)
    parted = rerun(recording(said=failing), tmp_path / "a.steps").parted
    assert parted is not None
    assert (parted.step, parted.now, parted.error) == (1, None, "no more ideas")


@pytest.mark.parametrize(
    ("lost", "missing"), [(1, "step 2 of life 1"), (2, "step 3 of life 1"), (5, "step 1 of life 2")]
)
def test_a_step_that_the_log_lacks_is_named(tmp_path: Path, lost: int, missing: str) -> None:
    """It would look like an agent that does something else; 5 is the first line of the second
    life.
    """
    path = tmp_path / "a.steps"
    logged(path, recording(), LIVES)
    rewritten(path, lost)
    parted = rerun(recording(), path).parted
    assert parted is not None
    assert parted.error == f"the log goes on with {missing}; steps are missing"


def test_a_tail_that_a_kill_took_is_no_difference(tmp_path: Path) -> None:
    """The next life begins from the journal."""
    path = tmp_path / "a.steps"
    logged(path, recording(said=answering), LIVES)
    rewritten(path, 4)
    found = rerun(recording(said=answering), path)
    assert (found.lives, found.steps, found.parted) == (2, 5, None)


def test_a_service_runs_again_instead_of_serving(
    tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    """No router, no journal, no device: only what it prints."""
    logged(tmp_path / "a.steps", recording(), LIVES)
    run = tmp_path / "run"

    def serve(options: Any) -> int:
        return shell.run(recording(), TO_ASKER, options)

    words = ["--replay", str(tmp_path / "a.steps"), "--run-dir", str(run)]
    assert cli.app("x", "A service.", serve)(words, standalone_mode=False) in (0, None)
    found = msgspec.msgpack.decode(capfdbinary.readouterr().out, type=Again)
    assert (found.agent, found.steps, found.parted) == ("server", 6, None)
    assert not run.exists()


def test_the_hash_is_of_the_whole_output(tmp_path: Path) -> None:
    """A step that is run again is compared by it: another record alone is noticed."""
    core = Core(recording(), TO_ASKER)
    _, effects = core.step(core.boot(None), Started(), 1.0)
    assert effects.record is not None
    assert fingerprint(effects) != fingerprint(replace(effects, record=effects.record + b"\x00"))
