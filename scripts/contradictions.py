"""Writes docs/design/paper-contradictions.md: each contradiction of the printed design, and how the
checker finds it.

`python scripts/contradictions.py` writes the page; a test compares it with what this says.
"""

from pathlib import Path

import msgspec
import paper_statements

from topdown.check import check
from topdown.model.design import load
from topdown.model.findings import Finding, Kind

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/design/paper-contradictions.md"
PRINTED = ROOT / "tests/topdown/paper_as_printed.toml"
STATEMENTS = ROOT / "tests/topdown/paper_statements.toml"
TABLE = ROOT / "tests/topdown/paper_contradictions.toml"

HEAD = """# Contradictions in the paper

The paper's design contradicts itself in these places. `roco design check
tests/topdown/paper_as_printed.toml` reports those about protocols and steps. The others follow
from the paper's figures and sentences in
[paper_statements.toml](../../tests/topdown/paper_statements.toml).
"""
BEYOND = """
## Undecided

The checker cannot decide:

"""
HEADINGS = {
    "statements": "Disagreeing statements",
    "tables": "Messages and protocols",
    "counts": "Table 8 and the protocols",
    "replay": "Channels and steps",
}
HOW = {
    paper_statements.Kind.CLAIM: "statements",
    Kind.UNBALANCED: "counts",
    Kind.NO_CHANNEL: "counts",
    Kind.NEVER_HEARD: "counts",
    Kind.NEVER_INTRODUCED: "replay",
    Kind.RENUMBERED: "replay",
    Kind.OUTCOME: "replay",
}


class Contradiction(msgspec.Struct, forbid_unknown_fields=True):
    """A contradiction of the printed design, with the finding's kind and its words."""

    text: str
    kind: str
    words: str

    def named_by(self, findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
        """The findings that name it."""
        return tuple(one for one in findings if one.kind == self.kind and self.words in str(one))


class Beyond(msgspec.Struct, forbid_unknown_fields=True):
    """A contradiction that no checker of designs can decide."""

    text: str
    because: str


class Known(msgspec.Struct, forbid_unknown_fields=True):
    """The file of both."""

    contradiction: tuple[Contradiction, ...]
    beyond: tuple[Beyond, ...]


def known() -> Known:
    """Return the known contradictions of the printed design."""
    return msgspec.toml.decode(TABLE.read_bytes(), type=Known)


def printed() -> tuple[Finding, ...]:
    """All findings of the printed design, and of what the paper states beside it."""
    design = load(PRINTED)
    return (*check(design), *paper_statements.findings(design, STATEMENTS))


def page() -> str:
    """The page's text."""
    table = known()
    text = HEAD
    for way, heading in HEADINGS.items():
        rows = [one.text for one in table.contradiction if HOW.get(one.kind, "tables") == way]
        text += f"\n## {heading}\n\n" + "".join(f"- {row}\n" for row in rows)
    return text + BEYOND + "".join(f"- {one.text}: {one.because}\n" for one in table.beyond)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
