"""Traffic of the fleet is as the design allows: who, to whom, in which act, language, class and size."""

from collections.abc import Iterable

import pytest
from pretended_fleet import Fleet

from agent_runtime.testing.memory_bus import Point
from companion.all_languages import LANGUAGES
from companion.design import DESIGN, language_of
from fipa_codec.communicate import Communicate, encode


def wrong(traffic: Iterable[Communicate]) -> set[str]:
    """Return the deviations from the design, in words."""
    return {found for one in traffic if (found := _wrong(one))}


def _wrong(one: Communicate) -> str:
    rule = DESIGN.rule(one)
    content, _ = LANGUAGES.read(one)
    here = f"{one.sender}->{one.receiver} {one.protocol} {one.performative}"
    if content is None:
        return "" if len(encode(one)) <= rule.bytes else f"{here}: {len(encode(one))} bytes"
    name = f"{language_of(content).name}.{type(content).__name__}"
    if name not in rule.sizes:
        return f"{here} says {name}, not one of {', '.join(rule.sizes)}"
    return "" if len(encode(one)) <= rule.sizes[name] else f"{here} {name}: {len(encode(one))} bytes"


def test_the_story_is_as_designed(fleet) -> None:
    """The main run."""
    fleet.say("pour the jar into the bowl")
    fleet.finish()
    assert not wrong(fleet.wires.traffic)


@pytest.mark.parametrize("after_s", [0.05, 3.0, 12.0, 20.0, 27.0, 33.0])
def test_a_cancelled_run_is_as_designed(after_s: float) -> None:
    """Cancels at several times, with a death of ex in two of them."""
    fleet = Fleet()
    if after_s in (12.0, 27.0):
        fleet.wires.crash("ex", Point.AFTER, in_steps=40)
    fleet.say("pour the jar into the bowl")
    fleet.wires.run_for(after_s)
    fleet.cancel()
    fleet.finish()
    assert not wrong(fleet.wires.traffic)
    fleet.close()


def test_the_paths_of_figure_8(fleet) -> None:
    """co and ta say request, then inform and confirm by turns; every inform has one confirm."""
    fleet.say("pour the jar into the bowl")
    fleet.finish()
    said = [str(one.performative) for one in fleet.wires.traffic if {one.sender, one.receiver} == {"co", "ta"}]
    assert said.count("inform") == said.count("confirm")
    assert said.count("request") == 2
