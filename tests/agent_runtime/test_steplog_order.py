"""Steps of several agents in an order in which they can have been, whatever their clocks showed."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from agent_runtime.core.events import Arrived
from agent_runtime.io.steplog import NOTHING, Step, StepLog, deeds, read
from topdown.model.design import load
from topdown.prove.paths import Follower

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
