"""Rows of agents are compared with the messages, both ways, and with the arcs; a spoilt one is
named.
"""

from spoiling import Change, design

from topdown.check import check
from topdown.model.findings import Kind

DESK = """row = [
  { in = ["idle"], on = "person order", say = ["order request"], to = "ordering" },
  { in = ["ordering"], on = "person regret", say = ["order cancel"] },
  { in = ["ordering"], on = "order agree" },
  { in = ["ordering"], on = "order inform", to = "idle" },
  { in = ["ordering"], on = "order inform[cancel]", to = "idle" },
  { in = ["ordering"], on = "order failure", to = "idle" },
]
"""
NAV = """row = [
  { in = ["idle"], on = "order request", say = ["order agree", "ask query-ref"], to = "asking" },
  { in = ["asking", "driving"], on = "order cancel", say = ["order inform[cancel]"], to = "idle" },
  { in = ["asking"], on = "ask inform", say = ["drive request"], to = "driving" },
  { in = ["asking"], on = "late ask", say = ["order failure"], to = "idle" },
  { in = ["driving"], on = "drive agree" },
  { in = ["driving"], on = "drive inform", then = "arrived" },
  { in = ["idle"], on = "tell_place confirm" },
]
choice = [
  { name = "arrived", ways = [{ say = ["order inform"], to = "idle" }, { say = ["tell_place inform", "order inform"], to = "idle" }] },
]
"""  # noqa: E501
ATLAS = """row = [
  { in = ["idle"], on = "ask query-ref", say = ["ask inform"] },
  { in = ["idle"], on = "tell_place inform", say = ["tell_place confirm"] },
]
"""
ROWS: list[Change] = [
    ("[agent.sends]\nperformatives = [\"request\"",
     DESK + "\n[agent.sends]\nperformatives = [\"request\""),
    ("[[agent.parameter]]\nname = \"tries\"", NAV + "\n[[agent.parameter]]\nname = \"tries\""),
    ("[agent.sends]\nperformatives = [\"inform\"",
     ATLAS + "\n[agent.sends]\nperformatives = [\"inform\""),
]  # fmt: skip


def test_rows_that_fit_have_no_findings() -> None:
    """Not a single one; words of a choice count."""
    assert check(design(*ROWS)) == ()


REGRET = '  { in = ["ordering"], on = "person regret", say = ["order cancel"] },\n'
AGREED = '  { in = ["driving"], on = "drive agree" },\n'
REFUSED = ', { in = ["idle"], on = "drive refuse" }'
SPOILT = (
    ('on = "order agree" }', 'on = "order agre" }', Kind.BAD_ROW, "'agre'"),
    ('to = "ordering" }', 'to = "odering" }', Kind.BAD_ROW, "no state 'odering'"),
    ('then = "arrived" }', 'then = "gone" }', Kind.BAD_ROW, "no choice 'gone'"),
    ('on = "late ask"', 'on = "late aks"', Kind.BAD_ROW, "'aks'"),
    (REGRET, "", Kind.RECEIVED_NOT_SENT, "says"),
    (AGREED, "", Kind.SENT_NOT_RECEIVED, "no row of nav takes it"),
    ('inform"], to', 'inform", "order refuse"], to', Kind.SENT_NOT_RECEIVED, "says order"),
    ('"drive agree" }', '"drive agree" }' + REFUSED, Kind.RECEIVED_NOT_SENT, ""),
)


def test_a_spoilt_row_is_found() -> None:
    """One finding of the right kind; it names the row or the message."""
    for old, new, kind, words in SPOILT:
        found = check(design(*ROWS, (old, new)))
        assert [one.kind for one in found] == [kind], (new, [str(one) for one in found])
        assert words in f"{found[0].where} {found[0].wrong}", new
        assert found[0].line is not None, new


def test_a_row_leads_where_arcs_lead() -> None:
    """nav's asking is left for driving by an arc; without it the row leads nowhere."""
    arc: Change = ('  { source = "asking", target = "driving", when = "way_found" },\n', "")
    found = check(design(*ROWS, arc))
    assert Kind.BAD_ROW in {one.kind for one in found}
    assert any(one.wrong == "no arcs lead from asking to driving" for one in found)


def test_a_ruling_answers_for_a_message_without_a_row() -> None:
    """It says why it is listed all the same."""
    cancel = 'performative = "cancel", language = "WAY", bytes = 100'
    ruled: Change = (cancel, f'{cancel}, ruling = "no hurry"')
    assert check(design(*ROWS, (REGRET, ""), ruled)) == ()
