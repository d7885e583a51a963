"""The judge on a system that is not the companion: a cart that is loaded at a dock, and asks it for
its stock.
"""

from typing import Any

import msgspec
import pytest

from fipa_codec.communicate import Communicate, encode
from fipa_codec.languages import REASON, Language, Languages, Reason
from fipa_codec.performatives import Performative as P
from topdown.judge.judge import PATIENCE_S, Judge
from topdown.judge.verdicts import Judgement
from topdown.judge.verdicts import Verdict as V
from topdown.model.design import Design, load

DESIGN = """
format = 2

[system]
name = "yard"
root = "Y"
key = "yard/{system}/{channel}/{sender}/{receiver}/{protocol}/{performative}"
[[requirement]]
id = "R1"
text = "load"
[[step]]
requirements = ["R1"]
divide = { group = "Y", into = ["cart", "dock"] }
tasks = [{ group = "cart", text = "drives" }, { group = "dock", text = "loads" }]
channels = [{ id = "K1", between = ["cart", "dock"], transmits = "loads" }]
[[language]]
name = "Y"
[[interface]]
name = "loads"
entries = [["request", "load", ["Y.Load"], ["Y.Loaded"]]]
[[interface]]
name = "stock"
entries = [["query-ref", "stock", ["Y.Stock"], ["Y.Loaded"]]]
[[protocol]]
name = "load"
channel = "K1"
follows = "request"
initiator = "cart"
participant = "dock"
durable = true
latency_s = 1.0
answer = ["agree"]
interface = ["loads"]
message = [
  { sender = "cart", performative = "request", language = "Y", content = ["Load"], bytes = 300 },
  { sender = "cart", performative = "cancel", language = "Y", bytes = 300 },
  { sender = "dock", performative = "agree", language = "Y", bytes = 300 },
  { sender = "dock", performative = "inform", language = "Y", content = ["Loaded"], bytes = 300 },
]
[[protocol]]
name = "ask"
channel = "K1"
follows = "query"
initiator = "cart"
participant = "dock"
durable = false
interface = ["stock"]
message = [
  { sender = "cart", performative = "query-ref", language = "Y", content = ["Stock"] },
  { sender = "dock", performative = "inform-ref", language = "Y", content = ["Loaded"] },
]
[[agent]]
name = "cart"
[[agent]]
name = "dock"
"""


class Load(msgspec.Struct, tag=True):
    """Load so much."""

    kg: int = 1


class Stock(msgspec.Struct, tag=True):
    """How much is there?"""


class Loaded(msgspec.Struct, tag=True):
    """So much."""

    kg: int = 1


LANGUAGE = Language("Y", Load | Stock | Loaded)
CONTENT = {P.REQUEST: Load(), P.QUERY_REF: Stock(), P.INFORM: Loaded(), P.INFORM_REF: Loaded()}
REQUESTED = "yard/s/K1/cart/dock/request/request"
FORTH = (P.REQUEST, P.CANCEL, P.QUERY_REF)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Design:
    """The yard."""
    path = tmp_path_factory.mktemp("yard") / "yard.toml"
    path.write_text(DESIGN)
    return load(path)


class Yard:
    """Traffic of the yard, and the judge's verdicts."""

    def __init__(self, design: Design, *, read: bool = True, born: bool = True) -> None:
        self.design = design
        self.judge = Judge(design, Languages([LANGUAGE]) if read else None)
        self.found: list[Judgement] = []
        for agent in ("cart", "dock") if born else ():
            self.judge.lived(agent, 1, 0.0, fresh=True)

    def say(self, act: P, at: float, id: str = "", key: str = "", **fields: Any) -> list[V]:
        """One of them says this in conversation c; the verdicts that brings."""
        sender, receiver = ("cart", "dock") if act in FORTH else ("dock", "cart")
        volatile = act in (P.QUERY_REF, P.INFORM_REF)
        content = CONTENT.get(act)
        given = {
            "content": msgspec.UNSET if content is None else LANGUAGE.encode(content),
            "language": "Y",
            "protocol": "query" if volatile else "request",
            "conversation": "c",
            "sent": at,
            "reply_with": id if act in FORTH else "",
            "id": id,
        } | fields
        one = Communicate(performative=act, sender=sender, receiver=receiver, **given)
        return self.heard(self.judge.hear(key or self.design.key("s", one), encode(one), at))

    def heard(self, judgements: tuple[Judgement, ...]) -> list[V]:
        """Keep them."""
        self.found += judgements
        return [one.verdict for one in judgements]

    def wait(self, now: float) -> list[V]:
        """Time passes."""
        return self.heard(self.judge.pass_time(now))


def test_a_conversation_is_followed_to_its_end(design: Design) -> None:
    """Each communicate legal, with the states of both roles after it."""
    yard = Yard(design)
    assert yard.say(P.REQUEST, 1.0, "1") == [V.LEGAL]
    assert yard.say(P.AGREE, 1.1, "1", in_reply_to="1") == [V.LEGAL]
    assert yard.say(P.INFORM, 1.2, "2", in_reply_to="1") == [V.LEGAL]
    assert [one.states for one in yard.found] == [(s, s) for s in ("asked", "agreed", "done")]
    assert [one.heard.n for one in yard.found] == [1, 2, 3]
    assert yard.judge.finish(10.0) == ()


def test_what_waits_for_its_explanation_is_judged_by_it(design: Design) -> None:
    """An answer heard before its question is legal once that is heard; a number before a smaller
    one, too.
    """
    yard = Yard(design)
    assert yard.say(P.AGREE, 1.0, "1", in_reply_to="1") == []
    assert yard.say(P.INFORM, 1.1, "3", in_reply_to="1") == []
    assert yard.say(P.REQUEST, 1.2, "1") == [V.LEGAL, V.LEGAL]
    assert yard.say(P.AGREE, 1.3, "2", in_reply_to="1") == []
    # number 3 was heard earlier, and is in its place only behind number 2, which is out of sequence
    assert yard.wait(1.3 + PATIENCE_S) == [V.OUT_OF_SEQUENCE, V.LEGAL]


def test_what_nothing_explains_waits_no_longer_than_patience(design: Design) -> None:
    """Then it is out of sequence; where the beginning may have been missed, it is not judged."""
    for born, verdict in ((True, V.OUT_OF_SEQUENCE), (False, V.NOT_JUDGED)):
        yard = Yard(design, born=born)
        assert yard.say(P.INFORM_REF, 1.0, "d-1") == []
        assert yard.wait(1.0 + PATIENCE_S - 0.01) == []
        assert yard.wait(1.0 + PATIENCE_S) == [verdict]
        assert yard.say(P.INFORM_REF, 9.0, "d-2") == [V.NOT_JUDGED]


def test_copies_are_copies_word_for_word(design: Design) -> None:
    """The same words again are a copy; other words under the same id are not."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1")
    assert yard.say(P.REQUEST, 2.0, "1") == [V.COPY]
    assert yard.say(P.REQUEST, 3.0, "1", content=LANGUAGE.encode(Load(5))) == [V.OUT_OF_SEQUENCE]
    assert yard.say(P.REQUEST, 3.0, "1", conversation="d") == [V.OUT_OF_SEQUENCE]


def test_a_question_asked_again_may_be_answered_again(design: Design) -> None:
    """Once more for each copy, and no more."""
    yard = Yard(design)
    assert yard.say(P.QUERY_REF, 1.0, "q") == [V.LEGAL]
    assert yard.say(P.QUERY_REF, 1.2, "q") == [V.COPY]
    assert yard.say(P.INFORM_REF, 1.3, "d-1", in_reply_to="q") == [V.LEGAL]
    assert yard.say(P.INFORM_REF, 1.3, "d-2", in_reply_to="q") == [V.LEGAL]
    assert yard.say(P.INFORM_REF, 1.3, "d-3", in_reply_to="q") == []
    assert yard.wait(9.0) == [V.OUT_OF_SEQUENCE]


def test_equal_to_reply_by_is_in_time(design: Design) -> None:
    """SC00061G; a moment later is late. Where the question was long on its way, that is told:
    nobody need have been slow but the wire.
    """
    for asked, sent, verdict, slow in (
        (1.0, 2.0, V.LEGAL, False),
        (1.0, 2.001, V.LATE, False),
        (-0.3, 2.5, V.LATE, True),
    ):
        yard = Yard(design)
        yard.say(P.QUERY_REF, 1.0, "q", reply_by=2.0, sent=asked)
        assert yard.say(P.INFORM_REF, 3.0, "d", in_reply_to="q", sent=sent) == [verdict]
        why = yard.found[-1].why
        late = f"{sent - 2.0:.3f} s after the reply-by of query-ref q"
        assert why.startswith(late) or verdict is V.LEGAL
        assert why.endswith("was heard 1.300 s after it was sent") == slow


def test_no_answer_is_told_once(design: Design) -> None:
    """About the question, when reply-by has passed and what was said in time would have been
    heard.
    """
    yard = Yard(design)
    yard.say(P.QUERY_REF, 1.0, "q", reply_by=2.0)
    assert yard.wait(2.0 + PATIENCE_S - 0.01) == []
    assert yard.wait(99.0) == [V.UNANSWERED]
    assert yard.found[-1].heard.communicate.performative is P.QUERY_REF  # type: ignore[union-attr]
    assert yard.wait(200.0) == []


def test_what_asks_for_nothing_is_not_unanswered(design: Design) -> None:
    """Nobody can answer an agree, so its reply-by makes nothing late either."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1")
    assert yard.say(P.AGREE, 1.1, "1", in_reply_to="1", reply_by=2.0) == [V.LEGAL]
    assert yard.wait(50.0) == []
    assert yard.say(P.INFORM, 60.0, "2", in_reply_to="1") == [V.LEGAL]


@pytest.mark.parametrize(
    ("cancelled", "cancel_by", "unanswered"),
    [
        (1.5, None, []),
        (2.0, 5.0, [P.CANCEL]),
        (2.1, None, [P.REQUEST]),
        (2.1, 5.0, [P.REQUEST, P.CANCEL]),
    ],
)
def test_a_cancel_in_time_takes_the_question_back(
    design: Design, cancelled: float, cancel_by: float | None, unanswered: list[P]
) -> None:
    """Nobody waits for the answer to the question then; to the cancel one does."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1", reply_by=2.0)
    yard.say(P.CANCEL, cancelled, "2", reply_by=cancel_by)
    assert yard.wait(99.0) == [V.UNANSWERED] * len(unanswered)
    told = [one.heard.communicate for one in yard.found if one.verdict is V.UNANSWERED]
    assert [one.performative for one in told if one is not None] == unanswered


def test_who_has_ended_owes_no_answer(design: Design) -> None:
    """A cancel that crosses a not-understood waits for nobody."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1")
    words = {"language": REASON.name, "content": REASON.encode(Reason("what?"))}
    assert yard.say(P.NOT_UNDERSTOOD, 1.1, "1", in_reply_to="1", **words) == [V.LEGAL]
    assert yard.say(P.CANCEL, 1.1, "2", reply_by=2.0) == [V.LEGAL]
    assert yard.wait(99.0) == []


def test_an_answer_to_a_cancel_has_a_deadline_of_its_own(design: Design) -> None:
    """An agree that crosses the cancel is none; and the time of the request is not the cancel's."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1", reply_by=9.0)
    yard.say(P.CANCEL, 1.1, "2", reply_by=2.0)
    assert yard.say(P.AGREE, 1.2, "1", in_reply_to="1") == [V.LEGAL]
    assert yard.say(P.INFORM, 2.5, "2", in_reply_to="2", content=msgspec.UNSET) == [
        V.WRONG_LANGUAGE,
        V.LATE,
    ]
    assert yard.found[-1].why.startswith("0.500 s after the reply-by of cancel 2")


def test_beside_a_cancel_without_a_label_an_agree_answers_the_request(design: Design) -> None:
    """Neither has a label that tells; the tables do."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1", reply_by=2.0)
    yard.say(P.CANCEL, 1.1, "2", reply_with="", reply_by=9.0)
    assert yard.say(P.AGREE, 3.0, "1") == [V.LATE]


def test_nobody_waits_for_the_answer_to_a_dead_agents_question(design: Design) -> None:
    """A question that no journal keeps ends with the life of who asked."""
    yard = Yard(design)
    yard.say(P.QUERY_REF, 1.0, "q", reply_by=2.0)
    yard.judge.lived("cart", 2, 1.5)
    assert yard.wait(99.0) == []


def test_slow_is_measured_to_the_act_that_answers(design: Design) -> None:
    """The design names the act; slowness is not a violation."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1")
    assert yard.say(P.AGREE, 2.1, "1", in_reply_to="1") == [V.SLOW]
    assert yard.say(P.INFORM, 60.0, "2", in_reply_to="1") == [V.LEGAL]
    assert not any(one.violation for one in yard.found)


def test_a_lost_number_loses_its_conversation_and_no_other(design: Design) -> None:
    """Words behind the hole are not judged in conversations under way, and judged in those that
    begin there.
    """
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1")
    assert yard.say(P.INFORM, 1.5, "2", in_reply_to="1") == []
    assert yard.wait(1.5 + PATIENCE_S) == [V.NOT_JUDGED]
    assert "was not heard" in yard.found[-1].why or yard.found[-1].why.startswith("the beginning")
    assert yard.say(P.REQUEST, 9.0, "2", conversation="d") == [V.LEGAL]


def test_an_agent_without_its_journal_numbers_from_one_again(design: Design) -> None:
    """A life with a smaller number: no copy, no gap."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1")
    yard.judge.lived("cart", 2, 2.0)
    assert yard.say(P.REQUEST, 3.0, "2", conversation="d") == [V.LEGAL]
    yard.heard(yard.judge.lived("cart", 1, 4.0))
    assert yard.say(P.REQUEST, 5.0, "1", conversation="e") == [V.LEGAL]


def test_without_languages_contents_are_not_read(design: Design) -> None:
    """Anything may be said in a language that is named; names are judged all the same."""
    yard = Yard(design, read=False)
    assert yard.say(P.REQUEST, 1.0, "1", content=msgspec.Raw(b"\xc0")) == [V.LEGAL]
    assert yard.say(P.REQUEST, 1.0, "2", conversation="d", language="Z") == [V.WRONG_LANGUAGE]
    read = Yard(design)
    assert read.say(P.REQUEST, 1.0, "1", content=msgspec.Raw(b"\xc0")) == [V.WRONG_LANGUAGE]


def test_no_budget_means_any_size(design: Design) -> None:
    """Zero bytes and zero seconds state no budget."""
    yard = Yard(design)
    assert yard.say(P.QUERY_REF, 1.0, "q" * 120) == [V.LEGAL]
    assert yard.say(P.INFORM_REF, 60.0, "d", in_reply_to="q" * 120) == [V.LEGAL]
    long = {"reply_with": "x" * 128, "conversation": "c" * 128}
    assert yard.say(P.REQUEST, 70.0, "1", **long) == [V.OVER_BUDGET]


@pytest.mark.parametrize("field", ["conversation", "id", "reply_with", "ontology"])
def test_text_that_could_move_a_terminals_cursor_is_malformed(design: Design, field: str) -> None:
    """Verdicts are printed: a label or word with other characters than it may have is judged, not
    shown.
    """
    yard = Yard(design)
    fields = {"id": "1", field: "a\x1b[2J"}
    assert yard.say(P.REQUEST, 1.0, key=REQUESTED, **fields) == [V.MALFORMED]
    assert "must match" in yard.found[0].why
    assert "\x1b" not in yard.found[0].why


def test_what_is_wrong_is_told_by_what_would_be_right(design: Design) -> None:
    """Each reason names the design's own words."""
    yard = Yard(design)
    yard.say(P.REQUEST, 1.0, "1", key=REQUESTED.replace("K1", "K2"))
    yard.say(P.REQUEST, 1.0, "2", key="somewhere", conversation="d")
    yard.say(P.PROPOSE, 1.0, "3", key="yard/s/K1/dock/cart/request/propose")
    yard.heard(yard.judge.hear(REQUESTED, b"\xc1", 1.0))
    for found, (verdict, words) in zip(
        yard.found,
        (
            (V.WRONG_CHANNEL, "the design has it on K1"),
            (V.WRONG_CHANNEL, "'somewhere' is none of a communicate"),
            (V.NOT_ENTITLED, "allowed: agree, inform, not-understood"),
            (V.MALFORMED, ""),
        ),
        strict=True,
    ):
        assert found.verdict == verdict
        assert words in found.why
    assert yard.found[3].channel == "K1"


def test_ended_conversations_are_forgotten(design: Design) -> None:
    """Words that come long after are not judged, and take no memory until then."""
    yard = Yard(design)
    for n in range(50):
        yard.say(P.QUERY_REF, 1.0, f"q{n}", conversation=f"c{n}")
        yard.say(P.INFORM_REF, 1.1, f"d{n}", conversation=f"c{n}", in_reply_to=f"q{n}")
    assert len(yard.judge._talks) == 50
    yard.wait(100.0)
    assert len(yard.judge._talks) == 0
    assert yard.say(P.INFORM_REF, 100.0, "d", conversation="c7") == [V.NOT_JUDGED]
