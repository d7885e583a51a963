"""Pages show the commands' output; a word of difference is found; no verb of `roco` is left out."""

from pathlib import Path
from typing import Any

import pytest
import shown
import verbs

EVERY = [block for page in shown.PAGES for block in shown.blocks(page)]
STATIC_PAGES = sorted({block.page for block in EVERY if block.order is None})
MANY_COMMANDS = (
    "back-ends.md",
    "design/commands.md",
    "experiments.md",
    "faults.md",
    "roco.md",
    "traffic.md",
)
"""Half of the processor's time of all pages: a long test each."""
PAGE = """# A page

<!-- output: static {words} -->
```
$ {command}
{text}
```
"""


def page(folder: Path, command: str, text: str, words: str = "") -> Path:
    """A page with one block."""
    path = folder / "page.md"
    path.write_text(PAGE.format(words=words, command=command, text=text), encoding="utf-8")
    return path


def found(path: Path, folder: Path) -> list[str]:
    """Return the differences that a check of its one block finds."""
    (block,) = shown.blocks(path)
    return [one.words for one in shown.differences(block, *shown.run(block, folder))]


def static_page(path: Path) -> Any:
    """Return the case of a page."""
    name = path.relative_to(shown.ROOT).as_posix()
    return pytest.param(
        path, id=name, marks=pytest.mark.long if name.removeprefix("docs/") in MANY_COMMANDS else ()
    )


@pytest.mark.process
@pytest.mark.timeout(300)
@pytest.mark.parametrize("path", list(map(static_page, STATIC_PAGES)))
def test_a_page_shows_what_its_commands_print(path: Path, tmp_path: Path) -> None:
    """On a recorded run; `scripts/outputs` rewrites the pages."""
    shown.place(tmp_path, recorded=True)
    wrong = []
    for block in shown.blocks(path):
        if block.order is None:
            wrong += shown.differences(block, *shown.run(block, tmp_path))
    assert not wrong, "\n".join(one.words for one in wrong)


def test_every_verb_of_roco_is_shown_with_its_output() -> None:
    """A new verb needs a block in a page: scripts/shown.py says how; `scripts/outputs --verbs`
    lists them.
    """
    assert verbs.not_shown(EVERY) == []


def test_all_verbs_are_known() -> None:
    """Verbs of verbs too."""
    names = list(verbs.every())
    assert {"up", "design check", "conversation"} <= set(names)
    assert "design" not in names


def test_what_is_shown_elsewhere_is_there() -> None:
    """A verb is left out only where a page that is named shows it, and while it is a verb."""
    for verb, where in verbs.ELSEWHERE.items():
        assert verb in list(verbs.every())
        assert f"scripts/{verb}" in (shown.ROOT / where.partition(";")[0]).read_text(
            encoding="utf-8"
        )


def test_a_verb_counts_as_shown_by_its_whole_name_only(tmp_path: Path) -> None:
    """`roco design check-all` shows no `design check`."""
    (block,) = shown.blocks(page(tmp_path, "roco design checks && roco status", "x"))
    left = verbs.not_shown([block])
    assert "design check" in left
    assert "status" not in left


OTHERWISE = [
    ("echo no findings", "a finding", ""),
    ("echo 3 findings", "4 findings", "like=times,sizes"),
    ("echo took 3 s", "needed 4 s", "like=times"),
    ("echo a; echo b", "a", ""),
    ("echo b; echo a", "a\nb", "like=numbers"),
    ("echo a; echo a; echo c", "a\nb", "like=lines"),
    ("echo a b", "a c", "like=wraps"),
    ("echo words", "words", "has=^[0-9]+$"),
    ("echo km idle", "pl idle", "fields=1"),
    ("echo km idle; echo pl idle", "km idle", "fields=1"),
    ("false", "", ""),
    ("true", "", "exit=1"),
]
ALIKE = [
    ("echo no findings", "no findings", ""),
    ("echo took 3.25 s for 10 kB", "took 14 s for 9.1 kB", "like=times,sizes"),
    ("echo 'pid 3141  up'", "pid 77  up", "like=pids"),
    ("echo '│   7 │'; echo '├──────┤'", "│ 1234 │\n├───┤", "like=numbers"),
    ("echo b; echo a; echo b", "a\nb", "like=lines"),
    ("echo see; echo the page", "see the\npage", "like=wraps"),
    ("echo until 2026-01-02 03:04", "until 2027-01-02 05:06", "like=times"),
    ("pwd", "/home/you/robot", ""),
    ("echo runs/2026-01-02_03-04-05", "runs/2026-11-21_18-36-20", ""),
    ("seq 9", "1\n2\n...", "first=2"),
    ("seq 9", "...\n9", "last=1"),
    ("seq 9", "3\n6", "only=[36]"),
    ("exit 3", "", "exit=3"),
    ("cat made", "here", "setup='echo here > made'"),
    ("echo 17 said", "4 said", "has='^[0-9]+ said$'"),
    ("echo km idle 7", "km  knows", "fields=1"),
]


@pytest.mark.timeout(60)
def test_what_is_shown_otherwise_is_found(tmp_path: Path) -> None:
    """Another word, number, line, order or exit code, as far as the block does not say that it may
    differ.

    Times, sizes, numbers of processes, folders and widths of columns may differ, only where the
    block says so.
    """
    assert [row for row in OTHERWISE if not found(page(tmp_path, *row), tmp_path)] == []
    assert [row for row in ALIKE if found(page(tmp_path, *row), tmp_path)] == []


def test_a_page_written_anew_shows_what_was_printed(tmp_path: Path) -> None:
    """The rest of the page stays as it was."""
    path = page(tmp_path, "echo new", "old")
    before = path.read_text(encoding="utf-8")
    (block,) = shown.blocks(path)
    shown.written(block, shown.run(block, tmp_path)[0])
    assert path.read_text(encoding="utf-8") == before.replace("\nold\n", "\nnew\n")
    assert found(path, tmp_path) == []


@pytest.mark.parametrize("words", ["like=anything", "frist=3"])
def test_a_comment_that_cannot_be_read_is_named(words: str, tmp_path: Path) -> None:
    """With page and line."""
    with pytest.raises(ValueError, match=r"page\.md:3: .*(anything|frist)"):
        list(shown.blocks(page(tmp_path, "echo", "", words)))


def test_a_shown_output_begins_with_its_command(tmp_path: Path) -> None:
    """Else nobody could run it."""
    path = tmp_path / "page.md"
    path.write_text("<!-- output: static -->\n```\nwords\n```\n", encoding="utf-8")
    with pytest.raises(ValueError, match="begins with"):
        list(shown.blocks(path))


def test_no_page_tells_where_it_was_made() -> None:
    """Folders of the machine that ran the commands stand in no page."""
    for path in shown.PAGES:
        for block in shown.blocks(path):
            assert not any(
                str(shown.ROOT) in one.text or "/tmp/" in one.text for one in block.shown
            ), block.where


# --- The outputs that need a running fleet: one fleet, all pages ----------------------------------


@pytest.mark.long
@pytest.mark.zenoh
@pytest.mark.timeout(900)
def test_pages_show_what_a_running_fleet_prints(tmp_path: Path) -> None:
    """`scripts/outputs --fleet` rewrites them."""
    shown.place(tmp_path, recorded=False)
    wrong = []
    try:
        for block in shown.in_order(EVERY):
            wrong += shown.differences(block, *shown.run(block, tmp_path))
    finally:
        shown.bash("roco down", tmp_path)
    assert not wrong, "\n".join(one.words for one in wrong)


def test_the_fleet_comes_up_first_and_goes_down_last() -> None:
    """By the numbers of the blocks."""
    commands = [one.command for block in shown.in_order(EVERY) for one in block.shown]
    assert "roco up" in commands[0]
    assert "roco down" in commands[-1]
