"""Guests of a design: what their rows give, what is wrong with a row, and that the conversations of
agents and the proof know nothing of them.
"""

import pytest
from msgspec.structs import replace

from agent_runtime.core.binding import wiring
from companion.design import DESIGN, LANGUAGES
from fipa_codec.performatives import Performative as P
from topdown.check import check
from topdown.model.design import Design
from topdown.model.elements import Guest, GuestUse
from topdown.model.errors import NoSuchEntry
from topdown.model.findings import Kind
from topdown.model.machines import machines
from topdown.model.rights import Right, rights
from topdown.prove.fleet import groups

GUEST, PLATFORM = (DESIGN.guests[name] for name in ("assistant", "platform"))
WISH, SENTENCE, QUESTION = GUEST.use
FOREIGN = PLATFORM.use[0]


def with_guests(*guests: Guest) -> Design:
    """The design with other guests, and what its guests alone say and hear beside communicates."""
    names = {*DESIGN.guests, *DESIGN.agents}
    signals = DESIGN.file.signal
    if not guests:
        signals = tuple(one for one in signals if not {*one.writers, *one.readers} <= names)
    file = replace(DESIGN.file, guest=guests, signal=signals)
    return Design(file, DESIGN.path, DESIGN.text, DESIGN.folder)


def with_guest(guest: Guest) -> Design:
    """The design with another one in place of one of its guests."""
    return with_guests(guest, PLATFORM if guest.by == GUEST.by else GUEST)


def with_more(*uses: GuestUse) -> Guest:
    """The guest with other rows besides."""
    return replace(GUEST, use=(*GUEST.use, *uses))


def with_wish(**changed) -> Guest:
    """A guest with another row for wishes, and no other row."""
    return replace(PLATFORM, use=(replace(FOREIGN, **changed),))


def with_sentence(number: int | None = None, **changed) -> Guest:
    """The guest with another row for sentences, or another message in it."""
    use = SENTENCE
    if number is not None:
        said = list(use.message)
        said[number] = replace(said[number], **changed)
        changed = {"message": tuple(said)}
    return replace(GUEST, use=(WISH, replace(use, **changed), QUESTION))


BARE = with_guests()


def test_a_guest_may_say_what_its_row_is_like_and_nothing_else():
    """The words of the use that it is like, in the interfaces that are named."""
    mine = {key: rule for key, rule in DESIGN.rules.items() if GUEST.name in key[:2]}
    assert {(s, r, str(act)) for s, r, _, act in mine if s == GUEST.name} == {
        ("assistant", "hi", "request"),
        ("assistant", "hi", "cancel"),
        ("assistant", "hi", "query-ref"),
        ("assistant", "hi", "not-understood"),
        ("assistant", "km", "query-ref"),
        ("assistant", "km", "not-understood"),
    }
    asked = mine[GUEST.name, "km", "query", P.QUERY_REF].contents
    assert "WM.ListObjects" in asked
    assert not {"WM.HypotheticalState", "WM.DropStates"} & set(asked)
    like = DESIGN.rules["hi", "co", "request", P.REQUEST]
    wished = mine[GUEST.name, "hi", "request", P.REQUEST]
    assert wished.contents == like.contents
    assert wished.sizes == like.sizes
    assert not any(rule.durable or rule.latest for rule in mine.values())


def test_a_use_that_is_like_no_other_has_its_own_words():
    """On the channel of guest and agent; the answers are those that a wish is made of."""
    asked = DESIGN.rules[GUEST.name, "hi", "query", P.QUERY_REF]
    told = DESIGN.rules["hi", GUEST.name, "query", P.INFORM_REF]
    wished = DESIGN.rules[GUEST.name, "hi", "request", P.REQUEST]
    assert asked.contents == ("CMD.Sentence",)
    assert {*told.contents} == {*wished.contents, "CMD.Stopped"}
    assert asked.channel == told.channel == wished.channel
    assert {asked.durable, told.durable} == {False}
    assert DESIGN.guest_use(GUEST.name, "hi", "query").name == SENTENCE.name
    assert DESIGN.guest_use(GUEST.name, "hi", "request").name == WISH.name
    with pytest.raises(NoSuchEntry, match="query, request"):
        DESIGN.guest_use(GUEST.name, "hi", "subscribe")


def test_agents_and_their_proof_know_no_guest():
    """Links, state machines, interfaces and the composed system are those of a design without."""
    for name in DESIGN.agents:
        assert wiring(name, "x", design=DESIGN, languages=LANGUAGES).links == (
            wiring(name, "x", design=BARE, languages=LANGUAGES).links
        )
        assert DESIGN.side(name) == BARE.side(name)
        assert DESIGN.peers(name) == BARE.peers(name)
    mine, bare = machines(DESIGN), machines(BARE)
    assert {name: (one.uses.keys(), one.rows) for name, one in mine.items()} == {
        name: (one.uses.keys(), one.rows) for name, one in bare.items()
    }
    assert groups(DESIGN) == groups(BARE) == ()


@pytest.mark.parametrize(
    ("guest", "channels", "sentences", "beside"),
    [
        (GUEST, ("G1", "G2"), True, {"put": set(), "subscribe": {"roco/x/_/telemetry/ex"}}),
        (
            PLATFORM,
            ("G3", "G4"),
            False,
            {
                "put": {"roco/x/_/missed/platform/hi", "roco/x/_/missed/platform/km"},
                "subscribe": {"roco/x/_/resaid/hi/platform", "roco/x/_/resaid/km/platform"},
            },
        ),
    ],
    ids=["assistant", "platform"],
)
def test_a_guest_has_the_rights_of_its_rows_alone(guest, channels, sentences, beside):
    """It writes its own words, and hears answers; beside them what signals say."""
    mine = [one for one in rights(DESIGN, "x") if one.identity == guest.name]
    puts = {one.key for one in mine if one.action == "put"}
    assert puts - beside["put"] == {
        f"roco/x/{channel}/{guest.name}/{agent}/{protocol}/{act}"
        for channel, agent, protocol, acts in (
            (channels[0], "hi", "request", ("request", "cancel", "not-understood")),
            (channels[1], "km", "query", ("query-ref", "not-understood")),
            *([(channels[0], "hi", "query", ("query-ref", "not-understood"))] * sentences),
        )
        for act in acts
    }
    assert beside["put"] <= puts
    hears = {one.key for one in mine if one.action == "subscribe"}
    own = {key for key in hears if key.split("/")[2] in channels}
    assert hears - own == beside["subscribe"]


def test_guests_give_nobody_else_a_right():
    """But the agents that they talk with, and recorders."""
    others = {"hi", "km", "monitor", "console"}
    before = {one for one in rights(BARE, "x") if one.identity not in others}
    after = {one for one in rights(DESIGN, "x") if one.identity not in others}
    mine = {one for one in after if one.identity in DESIGN.guests}
    assert after - before == mine - before
    assert Right("page", "subscribe", "roco/x/G1/hi/assistant/request/inform") not in after


@pytest.mark.parametrize(
    ("guest", "kind", "says"),
    [
        (replace(PLATFORM, name="hi"), Kind.TWICE, "the name of an agent"),
        (replace(PLATFORM, name="monitor"), Kind.TWICE, "the name of a recorder"),
        (replace(GUEST, each_minute=0), Kind.NO_BUDGET, "no budget"),
        (with_wish(like="pour"), Kind.UNDEFINED, "protocol 'pour'"),
        (with_wish(like=""), Kind.UNDEFINED, "protocol '' is not there"),
        (with_wish(agent="he"), Kind.UNDEFINED, "agent 'he'"),
        (with_wish(interface=("acts",)), Kind.UNDEFINED, "interface"),
        (with_wish(channel="C2"), Kind.NUMBER_TAKEN, "C2 is there"),
        (with_wish(name="act"), Kind.TWICE, "use act"),
        (with_more(WISH), Kind.TWICE, "wish"),
        (
            with_more(GuestUse(name="x", channel="G5", agent="hi", like="act")),
            Kind.SECOND_CHANNEL,
            "talks with hi on G1 already",
        ),
        (
            with_more(replace(WISH, name="x")),
            Kind.TWICE,
            "request with hi is used already",
        ),
        (
            with_more(replace(WISH, name="x", agent="co")),
            Kind.NUMBER_TAKEN,
            "G1 is there already, by guest assistant with hi",
        ),
        (with_sentence(like="execute_command"), Kind.TWO_FORMS, "messages of its own"),
        (with_sentence(follows="quarry"), Kind.UNDEFINED, "table 'quarry'"),
        (with_sentence(3, sender="km"), Kind.NO_END, "sender 'km'"),
        (with_sentence(0, bytes=0), Kind.NO_BUDGET, "no size budget"),
        (with_sentence(0, bytes=20), Kind.TOO_SMALL, "below the smallest"),
        (with_sentence(0, language="CDM"), Kind.UNDEFINED, "language 'CDM'"),
        (with_sentence(2, content=("*commands",)), Kind.UNDEFINED, "not an interface"),
        (with_sentence(2, performative=P.PROPOSE), Kind.NO_ROW, "no row for propose"),
        (with_sentence(ruling=""), Kind.MACRO_ACT, "macro act"),
    ],
)
def test_a_wrong_row_is_found(guest, kind, says):
    """Each by its name, and no other fault beside it."""
    (found,) = check(with_guest(guest))
    assert found.kind is kind
    assert says in found.wrong, found
