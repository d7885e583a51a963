"""Cycles of who waits for whom: found where a closed set of states is deaf, and only there."""

import pytest

from topdown.check import machines
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind

HEAD = """
[system]
name = "ring"
root = "all"
key = "k"
"""


def ring(**talks: dict[str, list[str]]) -> Design:
    """Agents in a ring, each asks the next (use `ab`: a asks b); talks: agent -> state -> uses.
    First states rest.
    """
    names = list(talks)
    pairs = [(one, names[(index + 1) % len(names)]) for index, one in enumerate(names)]
    uses = [
        f'[[protocol]]\nname = "{a}{b}"\nchannel = "{a}{b}"\ninitiator = "{a}"\nparticipant ='
        f' "{b}"\nfollows = "query"\ndurable = false\nmessage = []\n'
        for a, b in pairs
    ]
    agents = [
        f'[[agent]]\nname = "{agent}"\ninitial = "{next(iter(states))}"\nstate = ['
        + ", ".join(
            f'{{ name = "{s}", behaviour = "b", terminal = "t", talks = {uses} }}'
            for s, uses in states.items()
        )
        + "]\n"
        for agent, states in talks.items()
    ]
    empty = "requirement = []\nstep = []\nlanguage = []\ninterface = []\n"
    return Design(loading.read(empty + HEAD + "\n".join(uses + agents)))


def found(**talks: dict[str, list[str]]) -> list[Finding]:
    """The check's findings."""
    return list(machines.wait_findings(ring(**talks)))


def test_two_that_only_ask_each_other_wait() -> None:
    """Each has asked, and neither answers while it waits."""
    (one,) = found(a={"idle": ["ba"], "asking": ["ab"]}, b={"idle": ["ab"], "asking": ["ba"]})
    assert one.kind is Kind.WAITS
    assert "a in asking for b, b in asking for a" in one.wrong


def test_three_in_a_ring_wait() -> None:
    """The set is as large as the ring, and is told once."""
    (one,) = found(
        a={"idle": ["ca"], "asking": ["ab"]},
        b={"idle": ["ab"], "asking": ["bc"]},
        c={"idle": ["bc"], "asking": ["ca"]},
    )
    assert one.where == "agent a, agent b, agent c"


@pytest.mark.parametrize("listener", ["a", "b"])
def test_one_that_answers_while_it_waits_breaks_the_ring(listener: str) -> None:
    """Its state talks in what the other asks."""
    talks = {"a": {"idle": ["ba"], "asking": ["ab"]}, "b": {"idle": ["ab"], "asking": ["ba"]}}
    talks[listener]["asking"] = ["ab", "ba"]
    assert found(**talks) == []


def test_who_rests_waits_for_nobody() -> None:
    """In a state of rest nothing is asked yet: an agent leaves it by itself."""
    assert found(a={"idle": ["ab"], "serving": ["ba"]}, b={"idle": ["ba"], "serving": ["ab"]}) == []


def test_who_asks_nobody_waits_for_nobody() -> None:
    """A state that only serves has nothing to wait for."""
    assert (
        found(
            a={"idle": ["ab"], "serving": ["ba"]},
            b={"idle": ["ab"], "asking": ["ba"], "other": ["ab"]},
        )
        == []
    )
