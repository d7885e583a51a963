"""Agents that are linked directly: the router is for tools alone, and each agent has rules of its
own.

The depot as a person starts it, and bare sessions with the keys of its agents.
"""

import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import msgspec
import pytest
import zenoh
from depot_fleet import AGENTS, PATIENCE_S, Depot, running
from toy_fleet import wait_for

from agent_runtime.core import binding
from agent_runtime.io import issuing, secured
from agent_runtime.io.inbox import Inbox
from agent_runtime.io.options import Options
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.sessions import (
    Links,
    NoEndpointError,
    client_config,
    close,
    free_endpoint,
    open_links,
    open_router,
)
from agent_runtime.io.zenoh_wire import Bytes, ZenohWire
from companion.design import DESIGN, wiring
from console.fleet.local import Local
from fipa_codec.communicate import Communicate
from fipa_codec.languages import Languages
from fipa_codec.performatives import Performative
from operate.fleet_file import ProcessState
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.rights import families

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(150)]
GROUPED = Path(__file__).parents[1] / "topdown/grouped.toml"
SYSTEM = "roco"


# --- the rules of one agent, against sessions with the keys of others -----------------------------


class Agents:
    """Bare sessions with the keys of agents, linked as the design has it. `heard`: who said what
    each hears.
    """

    def __init__(self, keys: Path, *names: str) -> None:
        self.keys = keys
        self.endpoints = {name: free_endpoint().replace("tcp/", "tls/") for name in names}
        self.heard: dict[str, set[tuple[str, bytes]]] = {name: set() for name in names}
        self.sessions = {name: self._open(name) for name in names}
        self._declared = [
            session.declare_subscriber(DESIGN.keys_to(SYSTEM, name), partial(self._hear, name))
            for name, session in self.sessions.items()
        ]

    def _open(self, name: str) -> zenoh.Session:
        """A session that is this agent, and dials those of its neighbours that are here."""
        near = tuple(self.endpoints[peer] for peer in DESIGN.peers(name) if peer in self.endpoints)
        tls, rules = secured.links_tls(self.keys, name), secured.links_of(self.keys, name)
        return open_links(self.endpoints[name], near, tls, rules)

    def _hear(self, name: str, sample: zenoh.Sample) -> None:
        self.heard[name].add((str(sample.key_expr), sample.payload.to_bytes()))

    def client(self, name: str, identity: str) -> zenoh.Session:
        """A session with the key of an identity that dials one agent."""
        return zenoh.open(
            client_config(self.endpoints[name], secured.client_tls(self.keys, identity))
        )

    def close(self) -> None:
        """End all sessions."""
        self._declared.clear()
        for session in self.sessions.values():
            close(session)


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of the companion's agents with direct links."""
    folder = tmp_path_factory.mktemp("keys")
    issuing.issue(folder, DESIGN, (SYSTEM,))
    return folder


@pytest.fixture
def line(keys: Path) -> Iterator[Agents]:
    """co, pl, km, which are linked in a line."""
    agents = Agents(keys, "co", "pl", "km")
    yield agents
    agents.close()


def said(sender: str, receiver: str) -> str:
    """The first key that the design lets one agent put to another."""
    return keys_of(sender, receiver)[0]


def keys_of(sender: str, receiver: str) -> list[str]:
    """All keys that the design lets one agent put to another."""
    acts = [one for one in families(DESIGN, SYSTEM) if one.act]
    return [one.key for one in acts if (one.owner, one.peer) == (sender, receiver)]


def everything(session: zenoh.Session, data: bytes) -> None:
    """Put this on every key that the design has for anybody."""
    for family in families(DESIGN, SYSTEM):
        if not family.token:
            session.put(family.key, data)


def reached(line: Agents, session: zenoh.Session, name: str, key: str) -> None:
    """A word of a session has reached an agent, so that all it said before would have."""

    def put() -> bool:
        session.put(key, b"the last")
        return (key, b"the last") in line.heard[name]

    wait_for(put, f"{name} hears {key}")


def test_an_agent_hears_its_neighbours_and_nothing_in_their_name(line: Agents) -> None:
    """Whatever co puts, pl hears what the design lets co say to pl; km, to which pl could forward,
    hears nothing.
    """
    co = line.sessions["co"]
    reached(line, co, "pl", said("co", "pl"))
    everything(co, b"co's")
    reached(line, co, "pl", said("co", "pl"))
    reached(line, line.sessions["pl"], "km", said("pl", "km"))
    heard = {key for key, data in line.heard["pl"] if data == b"co's"}
    assert heard == {*keys_of("co", "pl")}
    assert {data for _, data in line.heard["km"]} == {b"the last"}


def test_whose_key_has_no_channel_is_heard_nowhere(line: Agents) -> None:
    """Not as itself, and not as who may speak there; nobody forwards for it. The router's key may
    not even connect.
    """
    for thief in ("hi", "ta", "console", "operator", "monitor", "page", "router"):
        with suppress(zenoh.ZError), line.client("pl", thief) as stranger:
            everything(stranger, b"forged by " + thief.encode())
    reached(line, line.sessions["co"], "pl", said("co", "pl"))
    reached(line, line.sessions["pl"], "km", said("pl", "km"))
    assert {data for name in ("co", "pl", "km") for _, data in line.heard[name]} == {b"the last"}


def test_a_thief_with_a_neighbours_key_is_that_neighbour_and_nothing_more(line: Agents) -> None:
    """A client with co's key at pl speaks as co to pl; pl forwards nothing of it."""
    with line.client("pl", "co") as thief:
        reached(line, thief, "pl", said("co", "pl"))
        everything(thief, b"forged")
        reached(line, thief, "pl", said("co", "pl"))
    reached(line, line.sessions["pl"], "km", said("pl", "km"))
    assert {key.split("/")[3:5] == ["co", "pl"] for key, _ in line.heard["pl"]} == {True}
    assert b"forged" not in {data for name in ("co", "km") for _, data in line.heard[name]}


def test_an_agent_that_is_not_told_of_a_neighbour_says_so(keys: Path) -> None:
    """Instead of being linked with the others alone."""
    with pytest.raises(
        NoEndpointError,
        match=r"no endpoint of hi, ta; it has co, pl, and co is linked with hi, pl, ta",
    ):
        Links(Options(keys=keys, agents={"co": "tls/h:1", "pl": "tls/h:2"}), wiring("co", SYSTEM))


def test_who_speaks_for_a_group_is_at_the_router(tmp_path: Path) -> None:
    """And hears there what a linked agent says to the group; the agent's words to others do not
    pass there.
    """
    design = Design(loading.read(GROUPED.read_text()), "grouped")
    at, ends = free_endpoint(), {"doer": free_endpoint(), "asker": free_endpoint()}
    router = open_router(at)
    wires = binding.wiring("doer", "one", design=design, languages=Languages())
    inbox, heard = Inbox(), list[str]()
    wire = ZenohWire(Links(Options(agents=ends), wires).open(), wires, 1, inbox)
    base = zenoh.open(client_config(at))
    ears = base.declare_subscriber(
        "roco/one/*/doer/*/*/*", lambda sample: heard.append(str(sample.key_expr))
    )
    try:
        drive = Communicate(
            performative=Performative.REQUEST, protocol="request", sender="doer", receiver="base",
            id="1",
        )  # fmt: skip
        wire.send(drive)  # there is no session at the router yet
        wire.join(zenoh.open(client_config(at)))
        reached = "roco/one/C2/doer/base/request/request"
        wait_for(lambda: wire.send(drive) and reached in heard, "the group hears")
        wire.send(msgspec.structs.replace(drive, receiver="asker"))
        told = "roco/one/C2/base/doer/request/inform"
        wait_for(
            lambda: base.put(told, b"there") or _said(inbox, told), "the agent hears the group"
        )
        assert set(heard) == {reached}
    finally:
        del ears
        for one in (wire, base, router):
            one.close()


def _said(inbox: Inbox, key: str) -> bool:
    """Whether something came on a key."""
    item = inbox.get(0.1)
    return isinstance(item, Bytes) and item.key == key


# --- a depot --------------------------------------------------------------------------------------


@pytest.fixture
def short() -> Iterator[Path]:
    """A folder whose name is short enough for sockets in it."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def as_designed(depot: Depot) -> None:
    """What was said was, in all that was done to it; what a cut holds up is slow or late, and what
    is volatile is not taken where its receiver was killed.
    """
    designed = {"legal", "copy", "slow", "late", "not taken"}
    assert [one for one in Local(depot.run).verdicts() if one.verdict not in designed] == []


def drops_copies(depot: Depot, seconds: int) -> None:
    """Copies in the name of an agent, put with its key, reach its neighbour, which drops them."""
    depot.roco(f"fault flood traffic --as mule --per-second 50 --for {seconds}")
    dropped = lambda: depot.beat("traffic").counts.get("taken before", 0)  # noqa: E731
    depot.wait(lambda: dropped() > 10 * seconds, "traffic drops copies")


def works_without_the_router(depot: Depot) -> None:
    """While it is away orders are delivered and recorded, and an agent that is killed then is
    linked again.
    """
    depot.roco("agent stop router")
    depot.goes_on()
    depot.kill("dispatcher")
    depot.goes_on()
    assert depot.seen("router").status.state is not ProcessState.READY
    depot.roco("agent start router")


def test_agents_linked_by_sockets_of_this_host_work(short: Path) -> None:
    """Also when the router is gone and one of them was killed, whose socket is left."""
    with running(short, "--links", "unix", count=90) as depot:
        links = depot.run / "links"
        assert {file.stem for file in links.glob("*.sock")} == set(AGENTS)
        assert links.stat().st_mode & 0o777 == 0o700
        works_without_the_router(depot)
        drops_copies(depot, 1)
    as_designed(depot)


@pytest.fixture(scope="module")
def depot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Depot]:
    """A depot whose agents are linked directly, with wires."""
    with running(tmp_path_factory.mktemp("links"), "--faults", count=90) as made:
        yield made


def test_no_agent_needs_the_router(depot: Depot) -> None:
    """And once it is back, tools reach the agents again."""
    works_without_the_router(depot)
    depot.roco("agent pause desk")
    depot.roco("agent start desk")
    depot.goes_on()


def without_mule(depot: Depot, before: dict[str, int]) -> None:
    """The dispatcher takes the mule for gone, and has all its other neighbours."""
    depot.wait(lambda: "mule" not in depot.beat("dispatcher").peers, "the mule is missed")
    left = {name: life for name, life in before.items() if name != "mule"}
    assert depot.beat("dispatcher").peers == left


def test_a_cut_link_parts_two_agents_and_no_others(depot: Depot) -> None:
    """The two take each other for gone, and meet again once it is healed."""
    before = depot.beat("dispatcher").peers
    cut = depot.begin("fault cut mule-dispatcher --for 30")
    without_mule(depot, before)
    depot.wait(lambda: "dispatcher" not in depot.beat("mule").peers, "the dispatcher is missed")
    assert "traffic" in depot.beat("mule").peers
    depot.roco("fault heal")
    cut.communicate(timeout=PATIENCE_S)
    depot.wait(lambda: depot.beat("dispatcher").peers == before, "they met again")
    depot.goes_on()


def test_agents_are_linked_again_with_new_keys_and_not_with_a_revoked_one(depot: Depot) -> None:
    """Each opens its links again, in the same life."""
    lives, keys = depot.beat("dispatcher").peers, depot.run / KEYS_FOLDER
    depot.roco("keys revoke mule --keys", str(keys))
    others = {name: life for name, life in lives.items() if name != "mule"}
    # while it opens its links again, it lives without them
    depot.wait(lambda: depot.beat("dispatcher").peers == others, "the mule alone is missed")
    for file in keys.glob("router*.key"):  # the supervisor makes all keys again
        file.unlink()
    depot.wait(lambda: depot.beat("dispatcher").peers == lives, "all are linked, with new keys")
    depot.goes_on()


def test_copies_in_the_name_of_an_agent_reach_its_neighbour(depot: Depot) -> None:
    """The work goes on."""
    drops_copies(depot, 2)
    depot.goes_on()


def test_a_person_speaks_in_the_place_of_an_agent_that_is_down(depot: Depot) -> None:
    """As that agent it is linked with its neighbours and hears their answers. While the agent lives
    it is refused.
    """
    say = (
        "send --as mule --to traffic --protocol passage --performative request --content",
        '{"type":"Enter","goal":"shelf_1"}',
    )
    assert "mule lives" in depot.roco(*say, code=1)
    depot.roco("agent stop mule")
    said = depot.roco(*say)
    depot.roco("agent start mule")
    assert "traffic > mule  agree" in said
    assert "receipted by traffic" in said


def test_what_was_said_was_as_designed(depot: Depot) -> None:
    """In all that was done here."""
    as_designed(depot)
