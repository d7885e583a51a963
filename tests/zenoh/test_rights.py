"""Every cell of the rights over TLS, at a real router and at the links of an agent: identity x key
x put, subscribe, query, queryable, token, watch. Allowed is exactly what the design says, written
out here a second time.
"""

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from queue import Queue
from typing import Any

import pytest
import zenoh
from guarded import FENCE, SYSTEM, Guarded, allowed, allowed_at, keys_of

from companion.design import DESIGN
from topdown.model.rights import ROUTER, identities

pytestmark = pytest.mark.zenoh
PEOPLE = tuple(name for name in identities(DESIGN) if name != ROUTER)
KEYS = keys_of(DESIGN)
AGENT = "co"
ACTIONS = ("put", "subscribe", "query", "queryable", "token", "watch")
DEADLINE_S = 20.0


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    """One router for all cells; each action of each identity has a session of its own."""
    one = Guarded(tmp_path_factory.mktemp("keys"))
    yield one
    one.close()


@pytest.fixture(scope="module", params=["", AGENT], ids=["router", AGENT])
def open_house(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Guarded]:
    """A guard that asks for certificates and allows everything."""
    one = Guarded(tmp_path_factory.mktemp("open"), request.param, {"enabled": False})
    yield one
    one.close()


@pytest.fixture(scope="module")
def linked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    """The links of the agent with most neighbours."""
    one = Guarded(tmp_path_factory.mktemp("linked"), AGENT)
    yield one
    one.close()


def until(condition: Callable[[], object], what: str) -> None:
    """Look every 2 ms until it holds."""
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.002)


def passed_the_fence(guarded: Guarded, session: zenoh.Session) -> None:
    """Once this returns the guard has decided all that the session declared or put before."""
    heard: Queue[str] = Queue()
    with guarded.guard.declare_subscriber(
        f"{FENCE}/in", lambda sample: heard.put(sample.payload.to_string())
    ):
        session.put(f"{FENCE}/in", "decided")
        assert heard.get(timeout=DEADLINE_S) == "decided"


def puts(guarded: Guarded, session: zenoh.Session) -> set[str]:
    """The keys that are let in."""
    heard: list[str] = []
    with guarded.guard.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr))):
        for key in KEYS:
            session.put(key, b"said")
        session.put(f"{FENCE}/end", b"")
        until(lambda: f"{FENCE}/end" in heard, "all puts are decided")
    return set(heard) - {f"{FENCE}/end"}


def subscribes(guarded: Guarded, session: zenoh.Session) -> set[str]:
    """The keys that are let out."""
    room, keys = zenoh.handlers.FifoChannel(8), (*KEYS, f"{FENCE}/end")
    ears = [session.declare_subscriber(key, room) for key in keys]
    passed_the_fence(guarded, session)
    for key in KEYS:
        guarded.guard.put(key, b"said")
    guarded.guard.put(f"{FENCE}/end", b"")
    until(lambda: ears[-1].try_recv() is not None, "the last word is heard")
    heard = {str(sample.key_expr) for ear in ears[:-1] if (sample := ear.try_recv()) is not None}
    for ear in ears:
        ear.undeclare()
    return heard


def queries(guarded: Guarded, session: zenoh.Session) -> set[str]:
    """The keys on which a question is let in: all of them have somebody who would answer."""
    with guarded.guard.declare_queryable("**", _answer, complete=True):
        passed_the_fence(guarded, session)
        assert _answered(session, f"{FENCE}/question")
        return {key for key in KEYS if _answered(session, key)}


def queryables(guarded: Guarded, session: zenoh.Session) -> set[str]:
    """The keys on which an answer would be got from it."""
    ears = [session.declare_queryable(key, zenoh.handlers.FifoChannel(8)) for key in KEYS]
    with session.declare_queryable(f"{FENCE}/question", _answer):
        passed_the_fence(guarded, session)
        asking = [guarded.guard.get(key, timeout=2.0) for key in KEYS]
        assert _answered(guarded.guard, f"{FENCE}/question")
    asked = {key for key, ear in zip(KEYS, ears, strict=True) if ear.try_recv() is not None}
    for ear in ears:
        ear.undeclare()
    assert len(asking) == len(KEYS)
    return asked


def tokens(guarded: Guarded, session: zenoh.Session) -> set[str]:
    """The keys of tokens that are let in."""
    held = [session.liveliness().declare_token(key) for key in KEYS]
    passed_the_fence(guarded, session)
    seen = _alive(guarded.guard, "**")
    for token in held:
        token.undeclare()
    until(lambda: not _alive(guarded.guard, "roco/**"), "the tokens are gone")
    return seen


def watches(guarded: Guarded, session: zenoh.Session) -> set[str]:
    """The keys of tokens that it sees, by subscription and by question."""
    live = session.liveliness()
    room, keys = zenoh.handlers.FifoChannel(8), (*KEYS, f"{FENCE}/on")
    ears = [live.declare_subscriber(key, room, history=True) for key in keys]
    passed_the_fence(guarded, session)
    held = [guarded.guard.liveliness().declare_token(key) for key in keys]
    until(lambda: ears[-1].try_recv() is not None, "the last token is seen")
    told = {str(sample.key_expr) for ear in ears[:-1] if (sample := ear.try_recv()) is not None}
    asked = {key for key in KEYS if _alive(session, key)}
    for one in (*ears, *held):
        one.undeclare()
    until(lambda: not _alive(guarded.guard, "roco/**"), "the tokens are gone")
    # a question beside a subscription to the same token may come back empty (zenoh 1.10.2)
    return told | asked


def _answer(query: Any) -> None:
    with query:
        query.reply(query.key_expr, b"answer")


def _answered(session: zenoh.Session, key: str) -> bool:
    return any(reply.ok is not None for reply in session.get(key, timeout=2.0))


def _alive(session: zenoh.Session, key: str) -> set[str]:
    replies = session.liveliness().get(key, zenoh.handlers.FifoChannel(2 * len(KEYS)), timeout=2.0)
    return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}


TRIES = dict(zip(ACTIONS, (puts, subscribes, queries, queryables, tokens, watches), strict=True))


def walked(guarded: Guarded, identities: Sequence[str]) -> dict[tuple[str, str], set[str]]:
    """The keys that get through, by identity and action; each has a session of its own."""
    found = {}
    for identity, action in itertools.product(identities, ACTIONS):
        with guarded.session(identity) as session:
            found[identity, action] = TRIES[action](guarded, session)
    return found


def test_exactly_the_cells_of_the_design(guarded: Guarded) -> None:
    """The cells that get through are those of the design, key by key; nobody asks, and nobody is
    asked.
    """
    assert len(KEYS) * len(PEOPLE) * len(ACTIONS) >= 400, "there are cells enough"
    wrong = []
    for (identity, action), through in walked(guarded, PEOPLE).items():
        wanted = {key for key in KEYS if allowed(DESIGN, identity, action, key)}
        if through != wanted or (wanted and action in ("query", "queryable")):
            wrong.append((identity, action, sorted(through ^ wanted)))
    assert not wrong


def test_exactly_the_cells_of_the_design_at_an_agent(linked: Guarded) -> None:
    """A neighbour says and hears what the design has between the two; all others nothing."""
    assert len(DESIGN.peers(AGENT)) == max(len(DESIGN.peers(name)) for name in DESIGN.agents)
    wrong = []
    for (identity, action), through in walked(
        linked, [name for name in PEOPLE if name != AGENT]
    ).items():
        wanted = {key for key in KEYS if allowed_at(AGENT, DESIGN, identity, action, key)}
        wrong += [(identity, action, sorted(through ^ wanted))] if through != wanted else []
    assert not wrong


def test_without_rules_every_cell_gets_through(open_house: Guarded) -> None:
    """Denials above are due to the rules: the same tries find nothing closed where there are
    none.
    """
    closed = {cell: set(KEYS) - through for cell, through in walked(open_house, ["co"]).items()}
    assert not any(closed.values()), closed


def test_a_wildcard_hears_no_more(guarded: Guarded) -> None:
    """Listening to everything is refused as a whole; to all of the system it is the recorder's
    right, and no more than that is heard.
    """
    for identity in PEOPLE:
        recorder = identity in DESIGN.file.system.recorders
        wanted = {key for key in KEYS if recorder and allowed(DESIGN, identity, "subscribe", key)}
        assert heard_wide(guarded, identity) == wanted, identity


def heard_wide(guarded: Guarded, identity: str) -> set[str]:
    """What comes to who listens to everything."""
    session = guarded.session(identity)
    wide = ("**", "*/**", f"roco/{SYSTEM}/**", f"roco/{SYSTEM}/*/*/*/*/*", f"roco/{SYSTEM}/_/**")
    heard: list[str] = []
    hear = lambda sample: heard.append(str(sample.key_expr))  # noqa: E731
    ears = [session.declare_subscriber(key, hear) for key in wide]
    end = session.declare_subscriber(f"{FENCE}/end", zenoh.handlers.FifoChannel(8))
    passed_the_fence(guarded, session)
    for key in KEYS:
        guarded.guard.put(key, b"said")
    guarded.guard.put(f"{FENCE}/end", b"")
    until(lambda: end.try_recv() is not None, "the last word is heard")
    for ear in (*ears, end):
        ear.undeclare()
    session.close()  # type: ignore[no-untyped-call]
    # those are its own, which no router has seen
    return {key for key in heard if not key.startswith(FENCE)}


def test_who_lives_may_be_asked(guarded: Guarded) -> None:
    """All that may see a token may also ask for it once, as `roco send` does; beyond the tokens
    nothing is told.
    """
    token = guarded.guard.liveliness().declare_token(f"roco/{SYSTEM}/_/alive/co/7")
    other = guarded.guard.liveliness().declare_token(f"roco/{SYSTEM}/_/state/co")
    for identity in PEOPLE:
        with guarded.session(identity) as session:
            reads = identity in DESIGN.signals["alive"].readers
            seen = {f"roco/{SYSTEM}/_/alive/co/7"} if reads else set()
            assert _alive(session, f"roco/{SYSTEM}/_/alive/co/*") == seen, identity
            assert not _alive(session, f"roco/{SYSTEM}/_/state/co"), identity
            assert not _alive(session, "**"), identity
    token.undeclare()
    other.undeclare()
