"""Statements of one thing in several places: figures, computed ones, bounds, words; those that
disagree are named.
"""

import sys
from pathlib import Path

from companion.design import DESIGN

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from paper_statements import Kind, findings

SOUND = """
[[claim]]
name = "wheels"
stated = [{ where = "the text", says = 4 }, { where = "the drawing", sum = [2, 2] }]

[[claim]]
name = "speed"
unit = "m/s"
tolerance = 0.1
stated = [
  { where = "the text", says = 1.0 },
  { where = "the table", product = [95], over = [100] },
  { where = "the law", most = 1.5 },
]

[[claim]]
name = "colours"
stated = [
  { where = "the text", says = ["red", "blue"] },
  { where = "the drawing", says = ["blue", "red"] },
]
"""
SPOILT = (
    ("sum = [2, 2]", "sum = [2, 1]", "the drawing: 3"),
    ("product = [95]", "product = [80]", "0.8 m/s (computed)"),
    ("most = 1.5", "most = 0.5", "at most 0.5"),
    ('["blue", "red"]', '["blue", "green"]', "green"),
)


def test_statements_that_disagree_are_named_and_no_others(tmp_path):
    """One finding for each, with its line."""
    file = tmp_path / "statements.toml"
    file.write_text(SOUND)
    assert findings(DESIGN, file) == ()
    for old, new, words in SPOILT:
        file.write_text(SOUND.replace(old, new))
        (found,) = findings(DESIGN, file)
        assert (found.kind, words in found.wrong) == (Kind.CLAIM, True), (new, found)
        assert found.line is not None
