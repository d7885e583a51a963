"""The step log where much is said: hashes tell apart whatever differs, and what came is read as it
came.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from driven import Seen, logged, recording, request
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from toy_agents import Want, single, wirings

from agent_runtime.core.agent import Agent
from agent_runtime.core.events import Arrived, Effects, Local, PeerChanged, Started
from agent_runtime.core.step import Core
from agent_runtime.core.turn import Turn
from agent_runtime.io import cli, shell, steplog
from agent_runtime.io.steplog import (
    HEAD,
    MUCH_BYTES,
    NOTHING,
    Again,
    Step,
    StepLog,
    again,
    deeds,
    digest,
    fingerprint,
    noted,
    read,
)
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative
from fipa_codec.performatives import Performative as P
from topdown.model.design import load
from topdown.prove.paths import Follower


def saying(*contents: str, record: bytes | None = None) -> Effects:
    """A step that says one text after the other."""
    acts = [
        Communicate(
            performative=Performative.INFORM,
            content=msgspec.Raw(msgspec.msgpack.encode(text)),
            id=str(number),
        )
        for number, text in enumerate(contents)
    ]
    return Effects(record, sends=tuple(acts))


SIZES = st.sampled_from([10, MUCH_BYTES - 10, MUCH_BYTES, 3 * MUCH_BYTES])


@given(SIZES, st.data())
def test_one_character_elsewhere_in_what_was_said_gives_another_hash(
    size: int, data: st.DataObject
) -> None:
    """At any place of a text of any size; the same text gives the same."""
    text, at = "x" * size, data.draw(st.integers(0, size - 1))
    other = f"{text[:at]}y{text[at + 1 :]}"
    assert fingerprint(saying(text)) == fingerprint(saying("x" * size))
    assert fingerprint(saying(text)) != fingerprint(saying(other))


@given(SIZES, SIZES)
def test_what_was_said_to_whom_and_in_which_order_counts(one: int, other: int) -> None:
    """Also where the contents are so much that only their checksums go in."""
    both = saying("x" * one, "y" * other)
    turned = msgspec.structs.replace(both, sends=both.sends[::-1])
    sends = tuple(msgspec.structs.replace(s, receiver="b") for s in both.sends)
    elsewhere = msgspec.structs.replace(both, sends=sends)
    found = {fingerprint(effects) for effects in (both, turned, elsewhere, saying("x" * one))}
    assert len(found) == 4
    assert (
        len({fingerprint(saying("x" * one, record=record)) for record in (None, b"1", b"2")}) == 3
    )


@given(st.lists(SIZES, min_size=1, max_size=3), st.floats(0.0, 1.0))
def test_what_came_is_read_as_it_came_up_to_where_the_log_is_torn(
    sizes: list[int], share: float
) -> None:
    """Its content stands in the line or behind it; a line whose content is not whole is none."""
    came = [Arrived(saying("x" * size).sends[0]) for size in sizes]
    with tempfile.TemporaryDirectory() as folder:
        path, ends = Path(folder) / "km.steps", [0]
        log = StepLog(path)
        for number, event in enumerate(came):
            log.write([noted(1, number, 0.0, event, Effects())])
            log.flush()
            ends.append(path.stat().st_size)
        log.close()
        whole = path.read_bytes()
        assert [msgspec.msgpack.decode(step.input, type=Arrived) for step in read(path)] == came
        assert not any(step.apart for step in read(path))
        cut = int(share * len(whole))
        path.write_bytes(whole[:cut])
        assert len(list(read(path))) == sum(end <= cut for end in ends[1:])


@given(st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_whatever_waits_the_file_ends_with_a_whole_line(sizes: list[int]) -> None:
    """So a kill -9 takes steps, and what the next life writes is readable."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(steplog, "BUFFER_BYTES", 200)
        path = Path(folder) / "km.steps"
        log = StepLog(path)
        for number, size in enumerate(sizes):
            log.write([noted(1, number, 0.0, Arrived(saying("x" * size).sends[0]), Effects())])
            there, lines = path.stat().st_size, list(read(path))
            assert log.waiting <= 200
            assert [step.step for step in lines] == list(range(len(lines)))
            assert sum(4 + len(msgspec.msgpack.encode(step)) for step in lines) == there, (
                "nothing after the last one"
            )
        log.close()
        assert len(list(read(path))) == len(sizes)


# --- Steps of several agents in an order in which they can have been ------------------------------


ROOT = Path(__file__).parents[2]
DESIGN = load(next((ROOT / "examples" / "depot").rglob("design.toml")))
LOGS = {
    path.stem: list(read(path))
    for path in (ROOT / "tests/histories/verified_depot/steps").glob("*.steps")
}
"""A recorded run of five agents in an order that is a path of the model."""

seconds = st.floats(-3600, 3600).map(lambda value: round(value, 3))


def shifted(steps: list[Step], agent: str, by: dict[str, float]) -> Iterator[Step]:
    """An agent's log as it would be if the clocks of all agents were wrong by some seconds."""
    for step in steps:
        data = step.input
        if step.kind == Arrived.__name__:
            one = msgspec.msgpack.decode(data, type=Arrived)
            said = one.communicate
            late = replace(said, sent=said.sent + by.get(said.sender, 0.0))
            data = msgspec.msgpack.encode(replace(one, communicate=late))
        yield replace(step, at=step.at + by[agent], input=data)


def ordered(folder: Path, by: dict[str, float]) -> list[tuple[str, object]]:
    """The recorded run's deeds with those clocks, in the order that is found."""
    for agent, steps in LOGS.items():
        path = folder / f"{agent}.steps"
        path.unlink(missing_ok=True)
        log = StepLog(path)
        log.write((step, NOTHING) for step in shifted(steps, agent, by))
        log.flush()
        log.close()
    return deeds(folder)


@pytest.mark.timeout(120)
@settings(max_examples=10, deadline=None)
@example(by=[60.0, -60.0, 5.0, 0.0, -0.02])
@given(by=st.lists(seconds, min_size=len(LOGS), max_size=len(LOGS)))
def test_clocks_that_are_wrong_change_no_cause(
    tmp_path_factory: pytest.TempPathFactory, by: list[float]
) -> None:
    """The run stays a path of the model: nothing is taken before it is said; each agent's steps
    keep their order.
    """
    done = ordered(tmp_path_factory.mktemp("steps"), dict(zip(sorted(LOGS), by, strict=True)))
    for agent, steps in LOGS.items():
        assert [deed for who, deed in done if who == agent] == [
            step.deed for step in steps if step.deed is not None
        ]
    assert Follower(DESIGN).follow(done) is None


# --- Replay of a step log -------------------------------------------------------------------------


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
