"""docs/delivery.md: each promise names a test, and each test it names exists."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"`([\w/]+\.py)::(\w+)`")


def promises() -> list[str]:
    """Return the sentences of the lists, up to what is not promised."""
    page = (ROOT / "docs/delivery.md").read_text().partition("## Not promised")[0]
    return re.findall(r"^- (.*?)(?=\n- |\n\n|\Z)", page, re.MULTILINE | re.DOTALL)


def test_each_promise_names_its_test() -> None:
    """A promise that nothing holds is none."""
    assert len(promises()) > 15
    assert [one for one in promises() if not NAMED.search(one)] == []


def test_each_test_named_exists() -> None:
    """Under that name, in that file."""
    named = [match for one in promises() for match in NAMED.findall(one)]
    missing = [
        (file, test)
        for file, test in named
        if not (ROOT / "tests" / file).is_file()
        or f"def {test}(" not in (ROOT / "tests" / file).read_text()
    ]
    assert missing == []
