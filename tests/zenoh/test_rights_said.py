"""Over TLS, with processes of the companion: what a thief of a key cannot say, and who tells of
what was denied.

The rules see keys only; so a lie inside a communicate and a copy are refused by whom they are said
to. A copy that is put by its own sender cannot be told from one that is sent again, and does as
little.
"""

import json
import time
from pathlib import Path

import msgspec
import pytest
import zenoh
from secured_fleet import SYSTEM, logged, serve, serve_linked, session
from toy_fleet import Fleet as Processes
from toy_fleet import wait_for

from agent_runtime.core.peers import unheard_text
from agent_runtime.impersonation import StandIn
from agent_runtime.io import issuing
from agent_runtime.io.options import Options
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import client_tls, links_file
from agent_runtime.io.sessions import Links, client_config
from companion.design import DESIGN, LANGUAGES, wiring
from companion.tasks.look_around.command import LookAround
from companion.tools.verbs.hi import Hi, address
from console.fleet.local import Local
from fipa_codec.communicate import Communicate, decode_strictly, encode, encode_strictly
from fipa_codec.performatives import Performative
from operate.file_names import LIVE_FILE

pytestmark = pytest.mark.zenoh
CMD = LANGUAGES.named("CMD")
RULE = DESIGN.rules["hi", "co", "request", Performative.REQUEST]
KEY = DESIGN.key_of(SYSTEM, RULE)
LOOK = Communicate(
    performative=Performative.REQUEST, protocol="request", sender="hi", receiver="co",
    language="CMD",
    ontology=RULE.ontology, content=CMD.encode(LookAround()), conversation="look",
)  # fmt: skip


@pytest.fixture
def fleet(secured_router: Processes) -> Processes:
    """A router with keys, and co."""
    serve_linked(secured_router, "co")
    return secured_router


def recorded(fleet: Processes) -> bytes:
    """hi says something that co takes; the bytes."""
    hi = wiring("hi", SYSTEM)
    links = Links(Options(keys=fleet.run / KEYS_FOLDER, agents=fleet.agents), hi)
    life = StandIn(hi, "listening", fleet.run, links)
    one = life.say(LOOK, labelled=True)
    list(life.hear(float("inf"), unless_receipted="co"))
    life.close()
    return encode(one)


def count(fleet: Processes, what: str) -> int:
    """Return the number of times co counted it."""
    return fleet.beat("co").counts.get(what, 0)


def planning(fleet: Processes) -> tuple[int, str]:
    """Return the number of requests to pl that nobody has receipted, and co's state."""
    beat = fleet.beat("co")
    return beat.unreceipted.get("pl", 0), beat.state


def test_a_lie_inside_a_communicate_is_refused(fleet: Processes) -> None:
    """hi's key lets a thief put on hi's keys; what says that it is of another is counted and named,
    and not taken.
    """
    for lie in ({"sender": "pl"}, {"receiver": "ta"}, {"performative": Performative.CANCEL}):
        claimed = msgspec.structs.replace(LOOK, id="1", **lie)
        puts(fleet, encode_strictly(claimed), count(fleet, "forged"))
        claims = f"{claimed.sender}/{claimed.receiver}/{claimed.protocol}/{claimed.performative}"
        line = str(logged(fleet, "co", "forged")[-1])
        assert (KEY in line, claims in line) == (True, True)
    assert fleet.beat("co").unreceipted == {}, "nothing is answered"


def puts(fleet: Processes, data: bytes, before: int) -> None:
    """Put it with hi's key until it is counted: co listens some time after its first heartbeat.

    Once in a while: of more than 20 of a kind in 10 s the log has a sum.
    """
    due = time.monotonic()
    with session(fleet, "hi", "co") as thief:

        def counted() -> bool:
            nonlocal due
            if time.monotonic() >= due:
                due += 1.5
                thief.put(KEY, data)
            return count(fleet, "forged") > before

        wait_for(counted, "it is counted")


def test_a_recorded_communicate_does_nothing_when_it_is_put_again(fleet: Processes) -> None:
    """By its sender it is counted and named each time, and the one task stays one. With pl's key co
    does not let it onto hi's key; on pl's own it is a lie, counted and named. ta's key does not
    hear what hi says to co.
    """
    heard: list[zenoh.Sample] = []
    with session(fleet, "ta", "co") as thief:
        thief.declare_subscriber(KEY, heard.append)
        copy = recorded(fleet)
    assert not heard
    wait_for(lambda: planning(fleet) == (1, "compSP"), "co asks for a plan, and nobody answers")
    with session(fleet, "hi", "co") as thief:
        for number in range(1, 4):
            thief.put(KEY, copy)
            wait_for(
                lambda number=number: count(fleet, "taken before") >= number, "a copy is counted"
            )
    one = decode_strictly(copy)
    line = logged(fleet, "co", "taken before")[-1]
    assert (line["sender"], line["id"]) == ("hi", one.id)
    assert planning(fleet) == (1, "compSP")
    before = count(fleet, "taken before")
    own = DESIGN.key_of(SYSTEM, DESIGN.rules["pl", "co", "request", Performative.AGREE])
    with session(fleet, "pl", "co") as thief:
        for _ in range(3):
            thief.put(KEY, copy)
        thief.put(own, copy)
        wait_for(lambda: count(fleet, "forged") == 1, "what came behind the three is counted")
    assert count(fleet, "taken before") == before
    assert own in str(logged(fleet, "co", "forged")[-1])


def test_who_is_denied_is_told_by_the_fleet(secured_router: Processes) -> None:
    """hi's rules deny co its answers: co's log, heartbeat and the recorder's news name co, hi and
    C2.
    """
    made = secured_router
    deny(links_file(made.run / KEYS_FOLDER, "hi"), f"roco/{SYSTEM}/C2/co/hi/")
    serve(made, "monitor", "co", "hi")
    for file in ("hi.json", "hi.heartbeat.json"):
        made.wait((made.run / file).exists, "hi listens", 40.0)
    made.wait(lambda: "co" in made.beat("hi").peers, "hi knows of co", 40.0)
    assert Hi(address(Local(made.run))).say("look around").task
    made.wait(lambda: made.beat("co").unheard, "co notices", 40.0)
    (one,) = made.beat("co").unheard
    assert (one.peer, one.channel, one.what) == ("hi", "C2", "said")
    line = logged(made, "co", "unheard")[-1]
    assert line["level"] == "warning"
    assert "what co says to hi on C2 is not received" in str(line["why"])
    assert "perhaps the rules of hi deny it" in unheard_text("co", one, one.since)
    told = "what co says to hi on C2 is not"
    made.wait(lambda: told in (made.run / LIVE_FILE).read_text(), "the recorder tells")


def deny(rights: Path, prefix: str) -> None:
    """Take keys that begin so from what an agent's neighbours may bring."""
    told = json.loads(rights.read_text())
    for rule in told["access_control"]["rules"]:
        if rule["id"].endswith(" brings words"):
            rule["key_exprs"] = [key for key in rule["key_exprs"] if not key.startswith(prefix)]
    rights.write_text(json.dumps(told))


def test_keys_that_are_made_anew_part_nobody(fleet: Processes) -> None:
    """Another authority under a fleet that runs: router and co listen again, and old keys do not
    count.
    """
    old = (fleet.run / KEYS_FOLDER).rename(fleet.run / "old")
    both = fleet.endpoint, fleet.agents["co"]
    with (
        zenoh.open(client_config(both[0], client_tls(old, "hi"))),
        zenoh.open(client_config(both[1], client_tls(old, "hi"))),
    ):
        issuing.issue(fleet.run / KEYS_FOLDER, DESIGN, (SYSTEM,))
        for name in ("router", "co"):
            log = fleet.run / f"{name}.log"
            fleet.wait(lambda log=log: "keys were renewed" in log.read_text(), f"{name} sees it")
        log = fleet.run / "router.log"
        wait_for(lambda: log.read_text().count("router listening") == 2, "it listens anew")
    wait_for(lambda: fleet.beat("co").up, "co is back")
    assert decode_strictly(recorded(fleet)).sender == "hi"
    for endpoint in both:
        with pytest.raises(zenoh.ZError):
            zenoh.open(client_config(endpoint, client_tls(old, "hi")))
