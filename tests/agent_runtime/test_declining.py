"""An agent without behaviours declines: in every protocol, by its mildest word, and that is the
end.
"""

import pytest
from msgspec import Struct

from agent_runtime.core.agent import NOES, Agent, Behaviour, unfilled
from agent_runtime.core.wiring import Delivery, Link, Wiring
from agent_runtime.testing.alone import Alone
from fipa_codec.languages import Language, Languages, Reason
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import PROTOCOLS
from fipa_codec.tables import Role


class Memory(Struct, frozen=True):
    """Nothing."""


class Say(Struct, frozen=True, tag=True):
    """Something."""


LANGUAGES = Languages((Language("L", Say),))
ALONE = [
    protocol for protocol in PROTOCOLS if protocol.name not in ("brokering", "recruiting")
]  # these need a third agent


def stub(protocol: str, says: dict[P, tuple[str, ...]] | None = None) -> Alone:
    """An agent with one behaviour that is not filled in, as the participant of a protocol."""
    agent = Agent(
        "a", "s", Memory(), {"s": Behaviour(lambda memory, turn: unfilled(memory, turn, "work"))}
    )
    delivery = Delivery.LATEST if protocol == "subscribe" else Delivery.DURABLE
    if protocol == "query":
        delivery = Delivery.VOLATILE
    link = Link("b", "C1", protocol, Role.PARTICIPANT, delivery, silent="L", says=says or {})
    return Alone(agent, Wiring("test", "a", (link,), LANGUAGES))


OPENINGS = [(protocol.name, act) for protocol in ALONE for act in sorted(protocol.openings)]


@pytest.mark.parametrize(("protocol", "act"), OPENINGS)
def test_whatever_is_asked_is_declined_and_over(protocol, act):
    """The answer comes in the same step, says which behaviour is missing, and leaves no
    conversation open.
    """
    one = stub(protocol)
    name = one.ask("b", protocol, act, Say())
    (answer,) = [said for said in one.said if said.conversation == name]
    assert answer.performative in (*NOES, P.NOT_UNDERSTOOD)
    assert one.content(answer) == Reason("behaviour work of a is not filled in")
    assert one.talks[name].ended
    assert one.state == "s"


def test_a_protocol_that_may_refuse_is_refused():
    """Request has refuse, so nothing stronger is said."""
    one = stub("request")
    assert one.answers(one.ask("b", "request", P.REQUEST, Say())) == (P.REFUSE,)


@pytest.mark.parametrize(
    ("says", "answer"),
    [
        ({P.FAILURE: (), P.NOT_UNDERSTOOD: ("reason.Reason",)}, P.FAILURE),
        ({P.INFORM: (), P.NOT_UNDERSTOOD: ("reason.Reason",)}, P.NOT_UNDERSTOOD),
    ],
)
def test_a_design_without_refuse_gets_the_next_word(says, answer):
    """Only acts that the design lists are said."""
    one = stub("request", says)
    assert one.answers(one.ask("b", "request", P.REQUEST, Say())) == (answer,)
