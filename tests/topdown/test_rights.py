"""Rights are what the rules of a design say, for any design; the router's rules are these and no
wider.
"""

import re
from pathlib import Path

import pytest
from msgspec.structs import replace

from companion.design import DESIGN
from topdown.check import check
from topdown.draw import book
from topdown.draw.document import Grid
from topdown.model.design import Design, load
from topdown.model.errors import NoSuchEntry
from topdown.model.rights import (
    ROUTER,
    Action,
    access_control,
    families,
    identities,
    rights,
    routed,
)

ROOT = Path(__file__).resolve().parents[2]
SMALLEST = load(ROOT / "shared/topdown/scaffold/smallest.toml")
GROUPED = load(ROOT / "tests/topdown/grouped.toml")
DESIGNS = {"companion": DESIGN, "smallest": SMALLEST, "grouped": GROUPED}


@pytest.fixture(params=DESIGNS)
def design(request: pytest.FixtureRequest) -> Design:
    """Each design at hand."""
    return DESIGNS[request.param]


def includes(wide: str, narrow: str) -> bool:
    """Whether a key expression holds another one (Zenoh's * is one chunk, ** any number of them at
    the end).
    """
    ours, theirs = wide.split("/"), narrow.split("/")
    if ours[-1] == "**":
        return len(theirs) >= len(ours) - 1 and includes(
            "/".join(ours[:-1]), "/".join(theirs[: len(ours) - 1])
        )
    return len(ours) == len(theirs) and all(
        a in ("*", b) for a, b in zip(ours, theirs, strict=True)
    )


def test_every_rule_has_one_speaker_and_its_hearers(design: Design) -> None:
    """Of each message of the design its sender may put it and its receiver hear it, nobody else; of
    what goes by the router also the recorders.
    """
    found = rights(design, "s")
    for rule in design.rules.values():
        key = design.key_of("s", rule)
        who = {(one.identity, one.action) for one in found if one.key == key}
        hearers = {rule.receiver}
        if not {rule.sender, rule.receiver} <= set(design.agents):
            hearers |= set(design.file.system.recorders)
        assert who == {(rule.sender, Action.PUT)} | {(name, Action.SUBSCRIBE) for name in hearers}


def test_nobody_queries_and_the_router_does_nothing(design: Design) -> None:
    """No right to ask or to answer; none for the router's identity."""
    found = rights(design, "s")
    assert not {one for one in found if one.action in (Action.QUERY, Action.QUERYABLE)}
    assert not {one for one in found if one.identity == ROUTER}
    assert ROUTER in identities(design)


def test_only_an_owner_writes_its_signals(design: Design) -> None:
    """Each process that puts or lives on a signal is named in it as its owner, and is among the
    writers.
    """
    found = rights(design, "s")
    for family in (one for one in families(design, "s") if not one.act):
        writes = [one for one in found if one.action in (Action.PUT, Action.TOKEN)]
        assert {one.identity for one in writes if one.key == family.key} == {family.owner}
        assert family.owner in design.signals[family.what].writers
        assert family.owner in family.key.split("/")


def test_an_agent_hears_receipts_of_its_own_peers_alone() -> None:
    """km: of all receipts it hears those that are for it."""
    mine = [one for one in rights(DESIGN, "s") if one.identity == "km" and "/receipt/" in one.key]
    heard = {one.key for one in mine if one.action == Action.SUBSCRIBE}
    assert heard == {f"roco/s/_/receipt/{peer}/km" for peer in DESIGN.peers("km")}


def test_the_router_lets_in_and_out_exactly_the_rights(design: Design) -> None:
    """Of the rules that carry anything (put, token) the key expressions are the rights', one by
    one; a declaration may be wider, but not beyond the system.
    """
    config = access_control(design, "s")
    subjects = {one["id"]: one["cert_common_names"] for one in config["subjects"]}
    of_rule = {rule: one["subjects"] for one in config["policies"] for rule in one["rules"]}
    way = {("ingress", "put"): "put", ("egress", "put"): "subscribe",
           ("ingress", "liveliness_token"): "token",
           ("egress", "liveliness_token"): "watch"}  # fmt: skip
    carried = set()
    for rule in config["rules"]:
        (flow,), (name,) = rule["flows"], of_rule[rule["id"]]
        assert rule["permission"] == "allow"
        assert subjects[name] == [name]
        assert not {"query", "reply", "declare_queryable", "delete"} & set(rule["messages"])
        if (flow, rule["messages"][0]) in way:
            assert len(rule["messages"]) == 1
            carried |= {(name, way[flow, rule["messages"][0]], key) for key in rule["key_exprs"]}
        else:
            assert flow == "ingress"
            assert all("/s/" in key or key.startswith("s/") for key in rule["key_exprs"])
    mine = {one.key for one in families(design, "s") if routed(design, one)}
    assert carried == {
        (one.identity, one.action, one.key) for one in rights(design, "s") if one.key in mine
    }
    assert carried
    assert (config["enabled"], config["default_permission"]) == (True, "deny")


def test_whatever_may_be_heard_may_be_listened_to(design: Design) -> None:
    """Each key that an identity has a right to hear at the router lies in what it may declare
    there.

    An agent's ears are its own alone.
    """
    keys = {rule["id"]: rule["key_exprs"] for rule in access_control(design, "s")["rules"]}
    mine = {one.key for one in families(design, "s") if routed(design, one)}
    for one in rights(design, "s"):
        word = {"subscribe": "listens", "watch": "looks"}.get(one.action)
        if word is not None and one.key in mine:
            wide = keys[f"{one.identity} {word}"]
            assert any(includes(key, one.key) for key in wide), one
    for agent in design.agents:
        for other in design.rules.values():
            key = design.key_of("s", other)
            heard = any(includes(wide, key) for wide in keys[f"{agent} listens"])
            assert not heard or other.receiver == agent


def shown(agent: str | None = None) -> set[tuple[str, bool, str]]:
    """The cells that `roco design show --what rights` has: identity, whether it writes, key."""
    (section,) = book.sections(DESIGN, book.Choice((book.What.RIGHTS,), agent=agent))
    messages, other = (part for part in section.parts if isinstance(part, Grid))
    rows = [(f"{key}/{act}", *who) for key, acts, *who in messages.rows for act in acts.split(", ")]
    return {
        (name, writes, f"roco/s/{key}")
        for key, *ends in (*rows, *other.rows)
        for writes, names in zip((True, False), ends, strict=True)
        for name in names.split(", ")
    }


def test_the_tables_show_every_right_and_no_other() -> None:
    """Of one identity: the rows in which it is."""
    every = {
        (one.identity, one.action in (Action.PUT, Action.TOKEN), one.key)
        for one in rights(DESIGN, "s")
    }
    assert shown() == every
    mine = {key for name, _, key in every if name == "page"}
    assert shown("page") == {one for one in every if one[2] in mine}
    with pytest.raises(NoSuchEntry):
        shown("pgae")


def test_a_writer_with_a_reach_writes_to_no_other_peers() -> None:
    """The page orders ta, asks ex for frames, and may put nothing else; the operator orders all."""
    for identity, others in (
        ("page", {"control/page/ta", "watch/page/ex"}),
        ("operator", {f"control/operator/{agent}" for agent in DESIGN.agents}),
    ):
        puts = [one for one in rights(DESIGN, "s") if one.action == Action.PUT]
        mine = {one.key for one in puts if one.identity == identity}
        assert mine == {f"roco/s/_/{key}" for key in others}


@pytest.mark.parametrize(
    ("pair", "wrong"), [(("pgae", "ta"), "'pgae'.*no writer"), (("page", "tb"), "'tb'.*no reader")]
)
def test_a_reach_of_nobody_is_found(pair: tuple[str, str], wrong: str) -> None:
    """Else a slip of the pen would let the writer reach all."""
    signals = tuple(replace(one, reach=(pair,)) if one.reach else one for one in DESIGN.file.signal)
    found = check(Design(replace(DESIGN.file, signal=signals), DESIGN.path))
    (one,) = (one for one in found if one.where == "signal control")
    assert re.search(wrong, one.wrong)
