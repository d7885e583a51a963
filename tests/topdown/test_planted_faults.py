"""Faults as designers make them, in designs of three domains, written before the tool was tried on
them: what it says first names the cause of each.
"""

import re
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from agent_runtime.core.errors import AgentTableError, BehaviourError
from agent_runtime.core.events import Effects
from agent_runtime.core.step import OUTSIDE
from fipa_codec.errors import LocalProtocolError
from topdown.check import check
from topdown.judge.steps import Done
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.prove.engine import DEAD, OUT_OF_REACH
from topdown.prove.paths import Follower
from topdown.prove.verify import tasks

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
sys.path[:0] = [str(EXAMPLES / "depot"), str(ROOT / "tests/examples")]

import depot_in_memory  # noqa: E402
from depot.carrier.behaviours import carrier  # noqa: E402

from agent_runtime.core.binding import BindingError  # noqa: E402
from agent_runtime.testing.memory_bus import Node, Quiet  # noqa: E402

DESIGNS = {
    "laboratory": ROOT / "tests/topdown/laboratory.toml",
    "depot": EXAMPLES / "depot/depot/design.toml",
    "dispatch": EXAMPLES / "dispatch/dispatch/design.toml",
}


class Plant(msgspec.Struct, forbid_unknown_fields=True):
    """What is replaced by what in a design, or in a module of the depot's agents; `words` that what
    is said first must have; `at`: words of the entry that it names.
    """

    name: str
    words: tuple[str, ...]
    change: tuple[tuple[str, str], ...]
    design: str = ""
    python: str = ""
    at: str = ""


class Plants(msgspec.Struct, forbid_unknown_fields=True):
    """The file of them."""

    fault: tuple[Plant, ...]
    bug: tuple[Plant, ...]


PLANTS = msgspec.toml.decode(
    Path(__file__).with_name("planted_faults.toml").read_bytes(), type=Plants
)


def changed(text: str, plant: Plant) -> str:
    """The text with the plant in it."""
    for old, new in plant.change:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def first_of_design(plant: Plant) -> Iterator[tuple[str, str]]:
    """What `check` says first, then what `verify` does; with the entry that it names."""
    place = DESIGNS[plant.design]
    text = changed(place.read_text(encoding="utf-8"), plant)
    try:
        design = Design(loading.read(text, str(place)), str(place), text, str(place.parent))
        for found in check(design)[:1]:
            yield f"{found.kind}: {found.where}: {found.wrong}", entry(text, found.line)
        for task in tasks(design, faults=1, layers=(3,)):
            for one in task.run(None).findings[:1]:
                text = "" if one.text in (DEAD, OUT_OF_REACH) and one.causes else one.text
                yield f"{one.kind}: {' '.join((text, *one.causes[:1]))}", ""
                return
    except DesignError as error:
        yield str(error), entry(text, error.line)


def entry(text: str, line: int | None) -> str:
    """The entry of a line: an inline one, or from its header up to the next."""
    lines = text.splitlines()
    if line is None or lines[line - 1].startswith(" "):
        return "" if line is None else lines[line - 1]
    headers = [at for at, one in enumerate(lines) if re.match(r"\[\[?\w+\]?\]", one)]
    begin = max((at for at in headers if at < line), default=0)
    return "\n".join(lines[begin : min((at for at in headers if at >= line), default=None)])


def first_of_behaviours(plant: Plant, patch: pytest.MonkeyPatch) -> str:
    """What is said first of the depot's agents, bound and run with the plant in one of them."""
    said: list[str] = []
    deeds: list[tuple[str, Done]] = []

    def watch(agent: str, effects: Effects) -> None:
        said.extend(
            f"{agent} {line.fields['why']}" for line in effects.logs if line.event == OUTSIDE
        )
        deeds.extend([(agent, effects.deed)] if effects.deed else [])

    try:
        plant_in(plant, patch)
        depot = depot_in_memory.Depot(*depot_in_memory.wishes(*(WAYS * ROUNDS)))
        depot.wires.on_step = watch
        for second, name, away_s in DEATHS:
            depot.wires.call(
                second, lambda name=name, s=away_s: depot.wires.kill(name, restart_s=s)
            )
        depot.wires.run(
            lambda: bool(said) or depot.wires.memory("desk").ended >= len(WAYS) * ROUNDS
        )
        depot.wires.run(lambda: bool(said) or all(map(rests, depot.wires.nodes.values())))
    except (BindingError, AgentTableError, BehaviourError, LocalProtocolError) as error:
        said.append(str(error))
    except Quiet as error:
        strayed = None if said else Follower(depot_in_memory.DESIGN).follow(deeds)
        said.append(f"{strayed.agent} {strayed.what}" if strayed else str(error))
    strayed = None if said else Follower(depot_in_memory.DESIGN).follow(deeds)
    return said[0] if said else f"{strayed.agent} {strayed.what}" if strayed else ""


WAYS = (("receiving", "store"), ("store", "press"))
ROUNDS = 4
DEATHS = (
    *((second, "traffic", 0.5) for second in range(5, 200, 5)),
    *((second, robot, 0.5) for second in range(3, 200, 7) for robot in ("mule", "ox")),
    *((second, robot, 12.0) for second in (0, 40, 80, 120) for robot in ("mule", "ox")),
)
"""When who dies, and how long it is away [s]: traffic while a robot waits, robots on the way, and
both while an order is put out.
"""


def rests(node: Node) -> bool:
    """Whether the agent is in a state of rest."""
    agent = depot_in_memory.DESIGN.agent(node.core.agent.name)
    return node.state is not None and node.state.state in (agent.rest or (agent.initial,))


def plant_in(plant: Plant, patch: pytest.MonkeyPatch) -> None:
    """Put the plant in the module of which the agents of the depot are made."""
    package, _, module = plant.python.removesuffix(".py").partition("/")
    source = EXAMPLES / "depot/depot" / plant.python
    made: Any = types.ModuleType(f"depot.{package}.{module}")
    exec(compile(changed(source.read_text(), plant), str(source), "exec"), made.__dict__)
    if package != "carrier":
        patch.setattr(getattr(depot_in_memory, package), "agent", made.agent)
        return
    maker = made.carrier if module == "behaviours" else carrier
    if module == "memory":
        for name in ("Memory", "Job", "CONDITIONS"):
            patch.setitem(carrier.__globals__, name, getattr(made, name))
    for robot in ("mule", "ox"):
        first = sys.modules[f"depot.{robot}.memory"].FIRST
        patch.setattr(
            getattr(depot_in_memory, robot), "agent", lambda robot=robot, f=first: maker(robot, f)
        )


def missing(plant: Plant, patch: pytest.MonkeyPatch) -> str:
    """What is missing in what is said first, "" where it names the cause."""
    lacking: list[str] = []
    told = [(first_of_behaviours(plant, patch), "")] if plant.python else first_of_design(plant)
    for said, named in told:
        lacks = [word for word in plant.words if word not in said]
        if plant.at and plant.at not in named:
            lacks.append(f"line of {plant.at!r}")
        if not lacks:
            return ""
        lacking.append(f"{lacks} in: {said}")
    return "\n".join(lacking) or "nothing was said"


def test_nothing_is_said_of_what_is_sound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither of the three designs nor of the behaviours."""
    for design in DESIGNS:
        assert list(first_of_design(Plant("sound", (), (), design))) == []
    sound = Plant("sound", (), (), python="carrier/behaviours.py")
    assert first_of_behaviours(sound, monkeypatch) == ""


@pytest.mark.parametrize("plant", PLANTS.fault, ids=lambda plant: plant.name)
def test_a_fault_is_named_first(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    assert missing(plant, monkeypatch) == ""


@pytest.mark.parametrize("plant", PLANTS.bug, ids=lambda plant: plant.name)
def test_a_bug_is_named_first(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    assert missing(plant, monkeypatch) == ""


def test_how_many() -> None:
    """As many as the table in benchmarks/README.md says."""
    assert (len(PLANTS.fault), len(PLANTS.bug)) == (45 + 29 + 30, 25 + 20)
