"""Rulings of a design are found, each with its place."""

from spoiling import Change, design

from topdown.model.design import rulings

RULED: list[Change] = [
    ("latency_s = 1.0\n", 'latency_s = 1.0\nruling = "nobody said how long"\n'),
    (
        'performative = "cancel", language = "WAY"',
        'performative = "cancel", ruling = "not printed", language = "WAY"',
    ),
]


def test_a_design_without_rulings_has_none() -> None:
    """Nothing is made up."""
    assert rulings(design()) == ()


def test_every_ruling_is_found_with_its_line() -> None:
    """On an entry, and on an entry inside it."""
    spoilt = design(*RULED)
    found = rulings(spoilt)
    assert [(one.where, one.text) for one in found] == [
        ("protocol order", "nobody said how long"),
        ("protocol order, message desk cancel", "not printed"),
    ]
    lines = spoilt.text.splitlines()
    assert all(one.line is not None and one.text in lines[one.line - 1] for one in found)
