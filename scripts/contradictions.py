"""Writes docs/design/paper-contradictions.md: each contradiction of the printed design, the finding
that names it.

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

HEAD = """# What the checker says of the paper's design as printed

`tests/topdown/paper_as_printed.toml` is the design of the Robot Companion as the paper prints it,
nothing repaired. Made by `python scripts/contradictions.py`;
`roco design check tests/topdown/paper_as_printed.toml` says the same, but for what is stated in
several places or counted (`tests/topdown/paper_statements.toml`), which no design file holds.

How a contradiction is found: *replay* of the steps; *tables*: messages against the rows of the
protocol they follow; *counts*: Table 8 against what the protocols allow; *statements*: two places
that the transcription puts side by side under one `claim`, which a program compares but could not
have found in prose.

| In the text we have | How | Finding | What the checker says |
|---|---|---|---|
"""
BEYOND = """
## Not in the power of a checker of designs

| What | Because |
|---|---|
"""
REST = """
## What else it finds

Gaps of what is printed, and the same faults in a second place: {gaps}.
"""
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
    findings, table = printed(), known()
    named = {one: entry.named_by(findings)[0] for one, entry in enumerate(table.contradiction)}
    rows = [
        f"| {entry.text} | {HOW.get(entry.kind, 'tables')} | {entry.kind} | {_cell(named[index])} |"
        for index, entry in enumerate(table.contradiction)
    ]
    beyond = [f"| {entry.text} | {entry.because} |" for entry in table.beyond]
    rest = [one for one in findings if one not in named.values()]
    counted = {kind: sum(one.kind == kind for one in rest) for kind in Kind}
    gaps = ", ".join(f"{count} x {kind}" for kind, count in counted.items() if count)
    return (
        HEAD + "\n".join(rows) + "\n" + BEYOND + "\n".join(beyond) + "\n" + REST.format(gaps=gaps)
    )


def _cell(finding: Finding) -> str:
    return f"{finding.where}: {finding.wrong}".replace("|", "/")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
