"""Fed with the paper's design as it stands, the checker names every contradiction that is in its
power.
"""

import sys
from pathlib import Path

import pytest

from topdown.model.findings import Finding, Kind

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
import contradictions

KNOWN = contradictions.known()
GAPS = {
    Kind.NOT_ASKED_AGAIN,
    Kind.NO_BUDGET,
    Kind.NO_MACHINE,
    Kind.SILENT_CHANNEL,
    Kind.UNDEFINED,
    Kind.NO_TALK,
}


@pytest.fixture(scope="module")
def findings() -> tuple[Finding, ...]:
    """The checker's findings."""
    return contradictions.printed()


def test_a_contradiction_is_named_by_one_finding(findings: tuple[Finding, ...]) -> None:
    """By kind and words, and with its line in the transcription."""
    for entry in KNOWN.contradiction:
        named = entry.named_by(findings)
        assert [(one.line is not None, bool(one.right)) for one in named] == [(True, True)], (
            entry.text
        )


def test_whatever_else_is_found_is_a_gap_or_its_consequence(findings: tuple[Finding, ...]) -> None:
    """Nothing is reported that is neither a known contradiction nor something the text leaves
    out.
    """
    named = {found for entry in KNOWN.contradiction for found in entry.named_by(findings)}
    rest = [found for found in findings if found not in named and found.kind not in GAPS]
    assert {(found.kind, found.where) for found in rest} == {
        (Kind.MACRO_ACT, "protocol I_ta_km_query, km inform-ref"),
        (Kind.NO_WAY_TO_THE_END, "protocol I_km_ta_subscribe"),
    }


def test_the_page_is_what_the_checker_says() -> None:
    """`python scripts/contradictions.py` writes it."""
    assert contradictions.PAGE.read_text(encoding="utf-8") == contradictions.page()
