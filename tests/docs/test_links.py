"""Links between pages lead to a file and a heading that are there; tests that pages name exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for pattern in (
        "*.md",
        "docs/**/*.md",
        "benchmarks/*.md",
        "requirements/*.md",
        "examples/**/*.md",
    )
    for page in ROOT.glob(pattern)
)
_FENCE = re.compile(r"^(`{3,}).*?^\1$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r'(?:\]\(|src=")([^)"\s]+)[)"]')
_TEST = re.compile(r"`((?:\w+/)*test_\w+\.py)`")
OF_THE_READER = ("design-your-own-robot.md", "design/commands.md", "extending.md")
"""Pages about a project or an agent that the reader makes, with tests of its own."""
ABOUT_THIS = [page for page in PAGES if not str(page).endswith(OF_THE_READER)]


def name(page: Path) -> str:
    """A page's path in the project."""
    return page.relative_to(ROOT).as_posix()


def prose(page: Path) -> str:
    """The text of a page without its fenced blocks."""
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def anchors(page: Path) -> set[str]:
    """The anchors of its headings, as GitHub makes them."""
    heads = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    texts = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", head).lower() for head in heads)
    return {re.sub(r"[^\w\- ]", "", text).replace(" ", "-") for text in texts}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    """To files of the project, and to headings of its pages."""
    wrong = []
    for link in _LINK.findall(prose(page)):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if re.match(r"[a-z]+:", link):
            continue
        if not target.exists() or (anchor and anchor not in anchors(target)):
            wrong.append(link)
    assert wrong == []


@pytest.mark.parametrize("page", ABOUT_THIS, ids=name)
def test_tests_that_are_named_exist(page: Path) -> None:
    """By their path from the root or from `tests/`, or by their name after such a path."""
    names = {found.name for found in ROOT.glob("tests/**/test_*.py")}
    wrong = [
        named
        for named in _TEST.findall(prose(page))
        if not any((folder / named).is_file() for folder in (ROOT, ROOT / "tests"))
        and ("/" in named or named not in names)
    ]
    assert wrong == []
