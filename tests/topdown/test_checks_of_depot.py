"""Faults planted in the design of the depot: each is one finding, at its line, that names the
cause.
"""

from pathlib import Path

import pytest

from topdown.check import check
from topdown.model import loading
from topdown.model.design import Design
from topdown.model.errors import DesignError
from topdown.model.findings import Kind

PLACE = Path(__file__).resolve().parents[2] / "examples/depot/depot/design.toml"
SOUND = PLACE.read_text(encoding="utf-8")
Change = tuple[str, str]

BOTH = 'when = ["tender_ox offered"]\nsay = ["tender_mule accept-proposal", '
RULE = '\n[[never]]\nname = "one at a time"\nagent = "traffic"\nsays = ["way_mule agree"]\n'
FAULTS: dict[str, tuple[Kind, str, str, tuple[Change, ...]]] = {
    "a child before its parent": (
        Kind.CHILD_FIRST,
        "step 4: handles requirement R6 before its parent R2",
        'requirements = ["R5", "R6"]',
        (
            ('requirements = ["R2", "R3"]', 'requirements = ["R3"]'),
            ('requirements = ["R5"]', 'requirements = ["R5", "R6"]'),
            ('requirements = ["R6"]', 'requirements = ["R2"]'),
        ),
    ),
    "a step without a requirement": (
        Kind.NO_REQUIREMENT,
        "step 5: handles no requirement; name the requirement it is for (R6:",
        "requirements = []",
        (('requirements = ["R6"]', "requirements = []"),),
    ),
    "one task twice": (
        Kind.SAME_TASK,
        "group mule has the task of floor (step 1)",
        'group = "mule"',
        (
            ('text = "carries" }', 'text = "the quick robot: drives and carries" }'),
            ('{ group = "mule", text = "the', '{ group = "mule", text = "The'),
        ),
    ),
    "a message larger than its budget": (
        Kind.TOO_SMALL,
        "protocol order, desk request: its budget of 12 bytes is below",
        "bytes = 12",
        (("bytes = 300\ntypical_bytes = 144", "bytes = 12"),),
    ),
    "durable within volatile": (
        Kind.OUTLIVES,
        "protocol way_mule: is durable, and opened within watch",
        'within = "watch"',
        (('within = "tender_mule"', 'within = "watch"'),),
    ),
    "a circle of uses": (
        Kind.WITHIN_ITSELF,
        "order within tender_mule within order; an estimate would count 0",
        'within = "tender_mule"',
        (("per = 1\ntypical_s = 0.1", 'per = 1\nwithin = "tender_mule"\ntypical_s = 0.1'),),
    ),
    "no receipts of the robots": (
        Kind.NO_RECEIPT,
        "mule takes durable messages of dispatcher and traffic, and may write them no receipt",
        "[[signal]]",
        (
            (
                'observations that are"\nwriters = ["agents"]',
                'observations that are"\nwriters = ["desk", "dispatcher", "traffic", "ox"]',
            ),
        ),
    ),
    "two arcs with one condition": (
        Kind.DEAD_ARC,
        "arc from pausing to calling: has the condition 'given_up' of the arc to idle",
        "",
        (
            (
                'source = "pausing"\ntarget = "calling"',
                'source = "pausing"\ntarget = "calling"\nwhen = "given_up"\n\n'
                '[[agent.arc]]\nsource = "pausing"\ntarget = "calling"',
            ),
        ),
    ),
    "a key without its sender": (
        Kind.KEY_LACKS,
        "lacks {sender}",
        "key = ",
        (("{channel}/{sender}/", "{channel}/"),),
    ),
    "an answer slower than its budget": (
        Kind.OVER_BUDGET,
        "typical_latency_s = 0.9 is above the budget latency_s = 0.5",
        "typical_latency_s = 0.9",
        (("typical_latency_s = 0.01", "typical_latency_s = 0.9"),),
    ),
    "rest in the middle of work": (
        Kind.NO_REST,
        "waiting is said to be a state of rest, and order is agreed|asked there",
        'rest = ["listening", "waiting"]',
        (
            (
                'initial = "listening"',
                'initial = "listening"\nrest = ["listening", "waiting"]',
            ),
        ),
    ),
    "a losing bidder": (
        Kind.NEVER_TOLD,
        "leaves tender_ox offered in carrying, and no row from there on says"
        " `tender_ox reject-proposal` or `tender_ox accept-proposal`: ox waits for ever",
        "[[agent.row]]",
        ((f'{BOTH}"tender_ox reject-proposal", ', BOTH),),
    ),
    "a guard on a state that cannot be": (
        Kind.NEVER_HOLDS,
        "row 5: its guard `order done` never holds: order is none in listening after the event",
        "[[agent.row]]",
        (
            (
                'on = "person wish"\ntext = ',
                'on = "person later"\nwhen = ["order done"]\n\n'
                '[[agent.row]]\nin = ["waiting"]\non = "person wish"\ntext = ',
            ),
            ('in = ["waiting"]\non = "person later"', 'in = ["listening"]\non = "person later"'),
        ),
    ),
    "an event that cannot come": (
        Kind.NEVER_HOLDS,
        "never applies: order is none in listening, where `order agree` cannot come",
        "[[agent.row]]",
        (('in = ["waiting"]\non = "order agree"', 'in = ["listening"]\non = "order agree"'),),
    ),
    "a word that the table forbids": (
        Kind.NEVER_HOLDS,
        "the table has no row for `order request`",
        "[[agent.row]]",
        (
            (
                'on = "order agree"\n',
                'on = "order agree"\n\n[[agent.row]]\nin = ["waiting"]\non = "order'
                ' inform[progress]"\nsay = ["order request"]\n',
            ),
        ),
    ),
    "a row of a state that no row leads to": (
        Kind.NEVER_HOLDS,
        "never applies: no row leads to awarding",
        "[[agent.row]]",
        (
            (
                '[[agent.row]]\nin = ["pausing"]',
                '[[agent.row]]\nin = ["awarding"]\non = "own doubt"\n\n'
                '[[agent.row]]\nin = ["pausing"]',
            ),
        ),
    ),
    "a guard word in place of a state": (
        Kind.NEVER_HOLDS,
        "`waiting` means that it waits for its turn, as `waits` of a row says",
        "[[agent.row]]",
        (
            (
                'when = ["tender_mule awarded"]\nsay = ["order failure"]',
                'when = ["tender_mule waiting"]\nsay = ["order failure"]',
            ),
        ),
    ),
    "a state with the name of a guard word": (
        Kind.RESERVED,
        "table passage: state 'waiting' of the initiator is a word of guards",
        "[table.initiator]",
        (
            ('["start", "send", "request", "asked"]', '["start", "send", "request", "waiting"]'),
            ('["asked", "receive", "agree"', '["waiting", "receive", "agree"'),
        ),
    ),
    "a rule of a word that nobody says": (
        Kind.NEVER_HOLDS,
        "never one at a time: no row of traffic says way_mule inform, so it forbids nothing",
        "says = ",
        (
            (
                "\n# --- agents: states",
                f'{RULE.replace("agree", "inform")}while = ["ox in delivering"]\n# --- agents:',
            ),
        ),
    ),
    "a rule of a state that cannot be": (
        Kind.NEVER_HOLDS,
        "`dispatcher order asked` never holds: order of dispatcher is agreed in carrying",
        "while = ",
        (
            (
                "\n# --- agents: states",
                f'{RULE}while = ["dispatcher in carrying", "dispatcher order asked"]\n# ---',
            ),
        ),
    ),
    "a rule of two states of one agent": (
        Kind.NEVER_HOLDS,
        "`dispatcher in carrying` never holds",
        "while = ",
        (
            (
                "\n# --- agents: states",
                f'{RULE}while = ["dispatcher in carrying", "dispatcher in idle"]\n# --- agents:',
            ),
        ),
    ),
}


def spoilt(*changes: Change) -> Design:
    """The depot with other words; each change replaces the first place of its words."""
    text = SOUND
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return Design(loading.read(text), str(PLACE), text, str(PLACE.parent))


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_the_only_finding(name: str) -> None:
    """Of its kind, in its words, at its line."""
    kind, words, line, changes = FAULTS[name]
    design = spoilt(*changes)
    found = check(design)
    assert [one.kind for one in found] == [kind], [str(one) for one in found]
    assert words in str(found[0])
    assert found[0].line is not None
    assert line in design.text.splitlines()[found[0].line - 1]


def test_a_division_in_three_is_told_in_a_sentence() -> None:
    """Not in a type of Python."""
    with pytest.raises(DesignError, match="in exactly two halves") as caught:
        spoilt(('into = ["desk", "dispatcher"]', 'into = ["desk", "dispatcher", "clerk"]'))
    assert "tuple" not in str(caught.value)
