"""The book about a design: as a page, as text, as files; complete, self-contained, the same every
time.
"""

import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import pytest

from topdown.draw import book, document
from topdown.draw.decomposition import natural
from topdown.draw.document import Figure, Grid
from topdown.draw.system import seconds, size
from topdown.model import elements, loading
from topdown.model.design import Design, load
from topdown.model.errors import NoSuchEntry

HERE = Path(__file__).parent
LAMP = load(HERE / "lamp.toml")
VOID = {"meta", "rect", "polyline", "polygon", "circle"}


class Reader(HTMLParser):
    """Collects what a page has, and checks that every element ends where it should."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: set[str] = set()
        self.words: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """An element begins."""
        self.tags.add(tag)
        found = dict(attrs)
        assert not found.keys() & {"src", "onclick", "onload"}
        if found.get("id"):
            self.ids.append(found["id"] or "")
        if found.get("href"):
            self.links.append(found["href"] or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """An element ends: the one that began last."""
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Words."""
        self.words.append(data)


def page_of(design: Design) -> str:
    """The page of all sections."""
    return book.page_of(design, book.sections(design))


def test_the_page_stands_alone() -> None:
    """Elements close, ids are unique, every link leads somewhere in it, and nothing is fetched or
    run. Each section has its heading, each figure its drawing.
    """
    page = page_of(LAMP)
    reader = Reader(page)
    assert not reader.open
    assert len(reader.ids) == len(set(reader.ids))
    assert reader.links
    assert {link.removeprefix("#") for link in reader.links} <= set(reader.ids)
    assert not reader.tags & {"script", "link", "img", "iframe", "object"}
    assert not [word for word in ("http:", "https:", "url(", "@import") if word in page]
    assert "prefers-color-scheme: dark" in page
    assert "@media print" in page
    sections = book.sections(LAMP)
    assert [one.what for one in sections] == [what for what in book.What if what != book.What.ALL]
    figures = [part for section in sections for part in section.parts if isinstance(part, Figure)]
    assert page.count("<svg") == len(figures) == len(book.figures(sections))


def test_markup_in_a_design_is_shown_as_it_is_written() -> None:
    """A name like <b> is not an element of the page."""
    text = LAMP.text.replace('"switch a lamp"', "'switch <b id=\"x\">&amp; a lamp'")
    reader = Reader(page_of(Design(loading.read(text))))
    assert "b" not in reader.tags
    assert any('<b id="x">&amp; a lamp' in word for word in reader.words)


TWICE = """
import sys; from pathlib import Path; from topdown.model.design import load
from topdown.draw import book; d = load(Path(sys.argv[1]))
sys.stdout.write(book.page_of(d, book.sections(d)))
"""


def test_the_same_design_gives_the_same_bytes() -> None:
    """Also in another process with another seed of hashes."""
    command = [sys.executable, "-c", TWICE, str(HERE / "lamp.toml")]
    for seed in ("1", "2"):
        seeded = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONIOENCODING": "utf-8"}
        page = subprocess.run(command, env=seeded, stdout=-1, check=True, encoding="utf-8").stdout
        assert page == page_of(LAMP)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_text_keeps_to_the_width(width: int) -> None:
    """No line is longer than the terminal is wide."""
    words = document.written(book.sections(LAMP, book.Choice(width=width)), width, long=True)
    assert max(map(len, words.splitlines())) <= width


def test_details_are_left_out_unless_wanted() -> None:
    """The rows behind a diagram are counted only; at length they are there."""
    sections = book.sections(LAMP, book.Choice((book.What.PROTOCOLS,)))
    assert "rows, not shown here" in document.written(sections)
    assert "takes request" in document.written(sections, long=True)
    assert "takes request" not in document.written(sections)


def test_a_step_is_summarized_as_in_the_papers_table_1() -> None:
    """Requirements, division, tasks, reallocation, new channels, and what they transmit."""
    (section,) = book.sections(LAMP, book.Choice((book.What.STEPS,), step=1))
    assert dict(section.parts[0].rows) == {  # type: ignore[union-attr]
        "Requirements": "R1 switch a lamp",
        "Division": "all := <hand, lamp>",
        "Tasks of hand": "asks",
        "Tasks of lamp": "shines",
        "Channel reallocation": "-",
        "New channels": "C1 hand-lamp",
        "C1 transmits": "on and off",
        "Groups after it": "hand, lamp",
        "Channels after it": "C1 hand-lamp",
    }


def table_of(design: Design, what: book.What, **choice: int) -> Grid:
    """The last table of a section."""
    (section,) = book.sections(design, book.Choice((what,), **choice))
    table = section.parts[-1]
    assert isinstance(table, Grid)
    return table


def test_a_leaf_without_evidence_is_told() -> None:
    """It is told only if the design names evidence at all."""
    two = (
        elements.Requirement(id="R1", text="switch a lamp"),
        elements.Requirement(id="R1a", text="on", parent="R1", evidence=("test:one", "event:two")),
        elements.Requirement(id="R1b", text="off", parent="R1"),
    )
    design = Design(msgspec.structs.replace(LAMP.file, requirement=two))
    table = table_of(design, book.What.REQUIREMENTS)
    assert table.rows == (("R1a", "test:one"), ("R1a", "event:two"), ("R1b", "none"))


def test_a_channel_is_four_buffers() -> None:
    """An input and an output buffer at both ends, each with what it holds."""
    table = table_of(LAMP, book.What.BUFFERS)
    assert [row[2:4] for row in table.rows] == [
        ("T_x c_hand", "from lamp"),
        ("T_y c_hand", "to lamp"),
        ("T_x c_lamp", "from hand"),
        ("T_y c_lamp", "to hand"),
    ]
    assert table.rows[0][4] == table.rows[3][4] == "request: inform, not-understood"
    assert table.rows[1][4] == table.rows[2][4] == "request: not-understood, request"


def test_a_protocol_that_the_design_does_not_use_is_drawn_by_its_table() -> None:
    """Between its roles; an unknown one is an error that lists those there are."""
    (section,) = book.sections(LAMP, book.Choice((book.What.PROTOCOLS,), protocol="subscribe"))
    figure = section.parts[0]
    assert isinstance(figure, Figure)
    assert "initiator" in figure.text
    assert "subscribe" in figure.text
    for choice in ({"protocol": "nonsense"}, {"step": 2}, {"step": -1}, {"agent": "foot"}):
        with pytest.raises(NoSuchEntry) as caught:
            book.sections(LAMP, book.Choice(**choice))  # type: ignore[arg-type]
        assert "protocol" not in choice or "switch" in caught.value.known


def test_numbers_are_written_for_people() -> None:
    """Sizes are exact; C2 stands before C10; no budget is a dash."""
    assert [size(n) for n in (0, 250, 1000, 4096, 65536, 1_000_000, 1_048_576, 1234)] == [
        "-", "250 B", "1 kB", "4 KiB", "64 KiB", "1 MB", "1 MiB", "1234 B",
    ]  # fmt: skip
    assert [seconds(t) for t in (0, 0.005, 0.5, 15)] == ["-", "5 ms", "500 ms", "15 s"]
    assert sorted(["C10", "C2", "C1a"], key=natural) == ["C1a", "C2", "C10"]


def test_a_word_too_long_is_broken_behind_a_mark() -> None:
    """In columns that are too narrow; other words stay whole."""
    assert document.cell("one LANGUAGE.VeryLongClass_name", 14) == [
        "one LANGUAGE.",
        "VeryLongClass_",
        "name",
    ]
    assert document.cell("", 5) == [""]
