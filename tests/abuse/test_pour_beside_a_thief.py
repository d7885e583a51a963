"""A pour beside the holder of an agent's key, who says all it may say with it: the pour ends, or
fails in words.

Garbage, words without content under numbers that the agent has used, will use next, or never
reaches, on every key.
"""

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh
from roco_fleet import Moment, RocoFleet

from companion.design import DESIGN
from companion.skills.loop_messages import Mode
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from topdown.model.rights import Family, families

pytestmark = [pytest.mark.zenoh, pytest.mark.long, pytest.mark.timeout(700)]

SYSTEM = "roco"
EVERY_S = 0.002
"""500 a second: what one sender may say of each kind is more (agent_runtime.io.inbox), and other
work goes on here.
"""
POUR_S = 400.0
"""At a load of 15 a pour beside a thief was half done after 180 s."""
USED = 300
"""Numbers that the streams of a pour reach; estimate."""


def word(family: Family, number: int) -> bytes:
    """Something that the key's owner could put there, or nothing that anybody could."""
    if not family.act or number % 3 == 0:
        return b"\xc1" * 200
    protocol, act = family.act.split("/")
    id = number % USED if number % 3 == 1 else 1_000_000 + number
    return encode(
        Communicate(
            performative=Performative(act), protocol=protocol, id=str(id),
            conversation=f"{family.owner}-1-{id}", sender=family.owner, receiver=family.peer,
        )
    )  # fmt: skip


@contextmanager
def thief(fleet: RocoFleet, identity: str) -> Iterator[None]:
    """Say it all with this identity's key, again and again."""
    keys = [one for one in families(DESIGN, SYSTEM) if one.owner == identity and not one.token]
    over = threading.Event()

    def say(session: zenoh.Session) -> None:
        for number, family in zip(itertools.count(), itertools.cycle(keys), strict=False):
            if over.wait(EVERY_S):
                return
            said, block = word(family, number // len(keys)), zenoh.CongestionControl.BLOCK
            session.put(family.key, said, congestion_control=block)

    with fleet.session(identity) as session:
        saying = threading.Thread(target=say, args=(session,))
        saying.start()
        try:
            yield
        finally:
            over.set()
            saying.join()


def acting(now: Moment) -> bool:
    """An arm moves."""
    return now.moving("move-joint")


@pytest.mark.parametrize("identity", DESIGN.agents)
def test_the_pour_ends_and_the_robot_is_whole(identity: str, tmp_path: Path) -> None:
    """From the first motion to the end of the task; afterwards the next task is done."""
    fleet = RocoFleet(tmp_path / "run")
    try:
        task = fleet.say("pour the jar into the bowl")
        fleet.reach(task, acting)
        with thief(fleet, identity):
            line = fleet.ended(task, within_s=POUR_S)
            heard = {name: fleet.beat(name).counts.get("garbled", 0) for name in DESIGN.agents}
        assert any(heard.values()), heard
        assert line.state == "done" or (line.state == "failed" and line.text), line
        begun = fleet.acts_begun()
        assert len(begun) == len(set(begun)), begun
        fleet.wait(fleet.whole, "the fleet is whole")
        assert fleet.state().mode is Mode.MOTION
        assert fleet.do("look around").state == "done"
    finally:
        fleet.down()
