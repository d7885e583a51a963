"""An agent's visit of another system, over a real router with its rights: words go there and back,
and a conversation that nobody there remembers ends in time.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from secured_fleet import SYSTEM
from toy_fleet import Fleet, wait_for

from agent_runtime.core.outside import GuestHears, GuestLeaves, GuestLost, GuestSays
from agent_runtime.io.guests import Visit
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import client_tls
from agent_runtime.io.visiting import LOOK_S, LOOKS, Visiting
from companion.design import DESIGN, LANGUAGES
from companion.tasks.look_around.command import LookAround
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(90)]

SCRIPT = Path(__file__).with_name("door_process.py")
USE = "velma.job"
LOST_S = LOOKS * (LOOK_S + 1.0) + 3.0
"""Until a dead peer is given up, and some seconds for a busy machine."""


class House:
    """The stand-in for hi, and the device that visits it; `told`: what the agent hears."""

    def __init__(self, router: Fleet) -> None:
        self.router, self.told = router, list[Any]()
        self.keys = router.run / KEYS_FOLDER
        self.lives = 0
        self.live()
        self.device = self.visitor()

    def visitor(self) -> Visiting:
        """The device of one life of the guest."""
        return Visiting(self.told.append, "velma", DESIGN, self._visit)  # type: ignore[arg-type]

    def _visit(self) -> Visit:
        tls = client_tls(self.keys, "bidder")
        return Visit(DESIGN, LANGUAGES, "bidder", SYSTEM, self.router.endpoint, tls)

    def live(self) -> None:
        """Another life of hi."""
        self.lives += 1
        command = [sys.executable, str(SCRIPT), self.router.endpoint, str(self.keys)]
        self.hi = subprocess.Popen(
            [*command, str(self.lives)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self.heard() == "ready"

    def heard(self) -> str:
        """The next line that hi prints."""
        assert self.hi.stdout is not None
        return self.hi.stdout.readline().strip()

    def ends(self, how: str) -> None:
        """Hi ends the open conversation so."""
        assert self.hi.stdin is not None
        print(how, file=self.hi.stdin, flush=True)

    def says(self, name: str, act: P = P.REQUEST) -> None:
        """The agent says it."""
        content = LookAround() if act is P.REQUEST else None
        self.device.tell(GuestSays(USE, name, act, content))

    def acts(self) -> list[tuple[str, str]]:
        """What the agent heard, in order."""
        return [
            ("lost", one.conversation) if isinstance(one, GuestLost) else (one.act, one.kind)
            for one in self.told
        ]

    def end(self) -> None:
        """All of it."""
        self.device.close()
        self.dies()

    def dies(self) -> None:
        """kill -9 of hi."""
        self.hi.kill()
        self.hi.wait()
        for pipe in (self.hi.stdin, self.hi.stdout):
            assert pipe is not None
            pipe.close()


@pytest.fixture
def house(secured_router: Fleet) -> Iterator[House]:
    """Both at the router."""
    made = House(secured_router)
    yield made
    made.end()


AGREED = [(P.AGREE, Kind.PLAIN), (P.INFORM, Kind.PROGRESS)]


def test_words_go_there_and_back(house: House) -> None:
    """One conversation after the other; contents in plain values."""
    for name, end, act in (("c1", "inform", P.INFORM), ("c2", "failure", P.FAILURE)):
        house.told.clear()
        house.says(name)
        assert house.heard() == "LookAround"
        wait_for(lambda: house.acts() == AGREED, "it is agreed")
        house.ends(end)
        wait_for(lambda a=act: house.acts() == [*AGREED, (a, Kind.PLAIN)], "it ended")
        assert house.told[-1] == GuestHears(USE, name, act, Kind.PLAIN, house.told[-1].content)
        assert house.told[-1].content["state"] in ("done", "failed")


def test_a_task_can_be_called_off(house: House) -> None:
    """By a cancel within the conversation."""
    house.says("c1")
    assert house.heard() == "LookAround"
    wait_for(lambda: house.acts() == AGREED, "it is agreed")
    house.says("c1", P.CANCEL)
    assert house.heard() == "cancel"
    house.ends("inform cancel")
    wait_for(lambda: house.acts() == [*AGREED, (P.INFORM, Kind.CANCEL)], "it is cancelled")


def test_another_life_of_the_guest_calls_its_task_off(house: House) -> None:
    """It knows the name alone, and hears nothing of it."""
    house.says("c1")
    assert house.heard() == "LookAround"
    wait_for(lambda: house.acts() == AGREED, "it is agreed")
    house.device.close()
    house.told.clear()
    house.device = house.visitor()
    house.device.tell(GuestLeaves(USE, "c1"))
    assert house.heard() == "cancel"
    house.ends("inform cancel")
    house.says("c2")
    assert house.heard() == "LookAround"
    wait_for(lambda: house.acts() == AGREED, "the next one is agreed")


def test_a_robot_that_is_killed_is_given_up_in_time(house: House) -> None:
    """kill -9, and nobody starts it again; the next word finds nobody."""
    house.says("c1")
    assert house.heard() == "LookAround"
    house.dies()
    killed = time.monotonic()
    wait_for(lambda: ("lost", "c1") in house.acts(), "it is given up", LOST_S)
    assert time.monotonic() - killed < LOST_S
    house.says("c2")
    wait_for(lambda: ("lost", "c2") in house.acts(), "nobody is found", LOST_S)


def test_a_robot_that_begins_anew_has_forgotten_the_task(house: House) -> None:
    """Another incarnation is not waited for; the next task is asked of it."""
    house.says("c1")
    assert house.heard() == "LookAround"
    house.dies()
    house.live()
    wait_for(lambda: ("lost", "c1") in house.acts(), "it is given up", LOST_S)
    house.told.clear()
    house.says("c2")
    assert house.heard() == "LookAround"
    wait_for(lambda: house.acts() == AGREED, "it is agreed")


def test_a_router_that_is_killed_ends_the_visit(house: House) -> None:
    """The bidder's bound holds for a whole fleet that is gone, too."""
    house.says("c1")
    assert house.heard() == "LookAround"
    house.router.kill("router")
    wait_for(lambda: ("lost", "c1") in house.acts(), "it is given up", LOST_S)
