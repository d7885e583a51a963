"""A group as an end of a channel: the other end must stand whatever the group says, and nothing
more is asked of it.
"""

from typing import NamedTuple

import pytest
from msgspec.structs import replace
from small import (
    ANSWERER,
    ASKER,
    LAMP,
    STUCK,
    TOLD,
    WATCHED,
    WATCHER,
    design,
    fleet,
    found,
    kinds,
    labels,
    less,
    row,
    verdicts,
)
from small import HAND as SMALL_HAND

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.prove.engine import WRONG, explore
from topdown.prove.fleet import ANY, QUEUE_BOUND
from topdown.prove.paths import Follower

HAND = (
    *SMALL_HAND[:3],
    TOLD,
    *SMALL_HAND[3:7],
    '{ in = ["waiting"], on = "switch failure", when = ["switch failed"], to = "idle" }',
    '{ in = ["waiting"], on = "switch failure", when = ["switch overtaken"] }',
    *SMALL_HAND[7:],
)
"""Takes whatever the table of request lets a lamp say."""
ANSWERED = (*ASKER, '{ in = ["asking"], on = "ask failure", to = "idle" }')
LISTENER = (
    '{ in = ["idle"], on = "back lamp", drop = ["watch"], say = ["watch subscribe"] }',
    '{ in = ["idle"], on = "own renewal", when = ["watch none"], say = ["watch subscribe"] }',
    *less(WATCHER, "back"),
    '{ in = ["idle"], on = "watch refuse" }',
    '{ in = ["idle"], on = "watch failure" }',
)
WATCHED_ANY = (*WATCHED, row("idle, busy, lit", "watch cancel", say="watch inform[cancel]"))


def with_group(group: str, rows: tuple[str, ...], *uses: str, acts: str = "") -> Design:
    """The small design in which one of the two is a group; `acts`: what it says, where not all that
    the use lists.
    """
    made = design(*((rows, ()) if group == "lamp" else ((), rows)), *uses)
    left = tuple(agent for agent in made.file.agent if agent.name != group)

    def kept(one: elements.Message) -> bool:
        return one.sender != group or not acts or one.performative in acts.split()

    said = tuple(
        replace(use, message=tuple(filter(kept, use.message))) for use in made.file.protocol
    )
    file = replace(made.file, agent=left, protocol=said, group=(elements.Group(group),))
    return Design(file, made.path)


def test_who_thinks_of_all_that_a_group_may_say_holds() -> None:
    """Durable, asked or observed, whichever end the group is, whatever dies."""
    for group, rows, use in (
        ("lamp", HAND, "switch"),
        ("hand", LAMP, "switch"),
        ("lamp", ANSWERED, "ask"),
        ("hand", ANSWERER, "ask"),
        ("lamp", LISTENER, "watch"),
        ("hand", WATCHED_ANY, "watch"),
    ):
        acts = "agree refuse inform" if use == "watch" and group == "lamp" else ""
        for most in (1, ANY):
            model = fleet(with_group(group, rows, use, acts=acts), most)
            assert explore(model).holds, (group, use)
            assert model.not_silent() == ()
            assert [note for note in model.unused() if "watch failure" not in note] == []


def test_a_subscription_that_a_group_ends_may_stay_unheard() -> None:
    """Its failure is said once, and may be lost: then the hand takes for live what is over."""
    made = with_group("lamp", LISTENER, "watch")
    assert not kinds(made, 0)
    assert kinds(made, 1) & set(STUCK)


def test_a_word_of_the_group_that_no_row_takes_is_found() -> None:
    """Each of them may come; a question to it may fail, which the asker does not handle here."""
    for taken in (one for one in HAND if "person" not in one):
        rows = tuple(one for one in HAND if one != taken)
        assert kinds(with_group("lamp", rows, "switch")) & {*STUCK, WRONG}, taken
    assert kinds(with_group("lamp", ASKER, "ask")) & {*STUCK, WRONG}


@pytest.mark.parametrize("words", ["own lit", "cancel"])
def test_an_agent_that_lets_a_group_wait_is_found(words: str) -> None:
    """The lamp never says that it is lit; it does not take a cancel, so that its end must come by
    itself.
    """
    assert bool(kinds(with_group("hand", less(LAMP, words), "switch")) & set(STUCK)) is (
        words == "own lit"
    )


def test_a_group_says_only_what_its_messages_list() -> None:
    """A lamp that lists `inform` alone neither refuses nor fails; the runtime still answers a
    cancel.
    """
    rows = less(HAND, "agree", "progress", "refuse", '"switch failure"')
    assert not kinds(with_group("lamp", rows, "switch", acts="inform"))
    told = labels(with_group("lamp", rows, "switch", acts="inform"))
    assert "lamp: says; switch inform -> hand" in told
    assert not any("refuse" in words or "agree" in words for words in told)
    told = labels(with_group("lamp", HAND, "switch", acts="refuse"))
    assert "hand: switch inform[cancel] <- lamp" in told
    assert "hand: switch inform <- lamp" not in told


def test_nobody_waits_for_a_free_choice_of_a_group() -> None:
    """That it asks, calls off or asks again is no way to rest; nor does a group that is gone for
    good end a wish.
    """
    asked = '{ in = ["idle"], on = "own start", to = "busy" }'
    served = row("idle, busy", "switch request", say="switch refuse", to="idle")
    assert kinds(with_group("hand", (asked, served), "switch")) & set(STUCK)
    made = with_group("lamp", less(HAND, "regret"), "switch")
    gone = verdicts(made, layers=(3,), gone=["lamp"])[-1]
    assert {one.kind for one in gone.findings} & set(STUCK)


def test_a_group_asks_again_only_as_the_model_does() -> None:
    """And it may give its question up, as anybody may; what it observed it owes, and does not
    merely say.
    """
    model = fleet(with_group("hand", ANSWERER, "ask"), 1)
    asked = next(there for who, _, there, _, _ in model.moves(model.start) if who == "hand")
    does = {what for who, what, *_ in model.moves(asked) if who == "hand"}
    assert does == {"late ask", "dies and comes back"}
    watched = labels(with_group("lamp", LISTENER, "watch"), 1)
    assert "lamp: says; watch inform -> hand" not in watched


def test_what_a_group_owes_it_says_in_the_same_step() -> None:
    """A subscription that is called off is answered at once."""
    bored = '{ in = ["idle"], on = "person bored", say = ["watch cancel"] }'
    ends = [row("idle", f"watch {word}[cancel]") for word in ("inform", "failure")]
    made = with_group("lamp", (*LISTENER, bored, *ends), "watch", acts="agree refuse inform")
    assert not kinds(made)
    told = labels(made)
    assert "lamp: watch cancel <- hand; watch inform[cancel] -> hand" in told
    assert "lamp: watch cancel <- hand" not in told


def test_a_group_waits_where_its_queue_is_full() -> None:
    """Progress that matters may be told for ever; the runtime holds the group back, so this is
    nothing wrong.
    """
    heard = row("waiting", "switch inform[progress]", say="switch cancel")
    again = row("waiting", "switch inform[progress]", when="switch cancelling|overtaken")
    model = fleet(with_group("lamp", (*less(HAND, "regret", "progress"), heard, again), "switch"))
    assert explore(model).holds
    assert max(map(len, model.parts.queues.values)) >= QUEUE_BOUND
    assert fleet(with_group("lamp", HAND, "switch")).endless() == ()


def test_an_end_that_is_nobody_is_said_in_words() -> None:
    """Neither an agent nor a group."""
    made = with_group("lamp", HAND, "switch")
    words = "protocol switch: 'lamp' is neither an agent nor a group; agents are hand"
    with pytest.raises(DesignError, match=words):
        fleet(Design(replace(made.file, group=()), made.path))


def test_what_a_group_says_is_in_the_story() -> None:
    """By its name, as a lifeline of its own."""
    rows = less(HAND, "agree", "regret")
    (one,) = found(with_group("lamp", rows, "switch")).findings
    assert one.start == {"hand": "idle", "lamp": "anything"}
    assert [step.who for step in one.trace] == ["hand", "lamp", "lamp", "lamp"]


class Done(NamedTuple):
    """A step of a running agent."""

    before: str
    event: str
    took: tuple[str, P, Kind] | None
    said: tuple[tuple[str, P, Kind], ...]
    after: str
    owed: tuple[str, ...] = ()


def test_a_run_beside_a_group_is_followed() -> None:
    """The group's own steps do not show: the hand hears an answer, and could not have heard another
    one.
    """
    asks = Done("idle", "Local wish", None, (("switch", P.REQUEST, Kind.PLAIN),), "waiting")
    heard = Done("waiting", "Taken", ("switch", P.INFORM, Kind.PLAIN), (), "idle")
    again = Done("waiting", "Taken", ("switch", P.INFORM, Kind.CANCEL), (), "idle")
    made = with_group("lamp", HAND, "switch")
    assert Follower(made).follow([("hand", asks), ("hand", heard)]) is None
    wrong = Follower(made).follow([("hand", asks), ("hand", again)])
    assert wrong is not None
    assert wrong.number == 2
