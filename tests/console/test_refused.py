"""What the operating system refuses of `roco` is told in a line, and its output can be shown by any
terminal.
"""

import json
import os
import shutil
import subprocess
import sys
from io import BytesIO, TextIOWrapper
from itertools import product
from pathlib import Path

import pytest
from calling import printed, roco

from console.__main__ import main
from console.fleet import checkup

pytestmark = pytest.mark.process

ACL = '(inform :content "ż 😀")'
VERBS = [
    ["--help"],
    ["--version"],
    ["doctor"],
    ["acl", "show", ACL],
    ["design", "check"],
    ["design", "show"],
    ["design", "new", "lamp"],
    ["protocol"],
]


def process(
    *words: str, cwd: Path, out: int | None = subprocess.PIPE, **variables: str
) -> "subprocess.CompletedProcess[bytes]":
    """`roco` as a process to its end."""
    command = [sys.executable, "-P", "-m", "console", *words]
    shared = os.environ | {"COLUMNS": "80"} | variables
    return subprocess.run(
        command, cwd=cwd, env=shared, stdout=out, stderr=subprocess.PIPE, timeout=50
    )


def refused(*words: object) -> str:
    """The sentence of what is refused, the same for people and for programs; exit code 2."""
    said = roco(*words, code=2)
    told = printed(*words, code=2)
    assert said.stdout == ""
    assert list(told) == ["error"]
    assert said.stderr.startswith("roco: ")
    assert len(said.stderr.splitlines()) == 1
    return said.stderr


def test_a_folder_that_may_not_be_written_to_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """/dev/pts takes no folder, also of root."""
    monkeypatch.chdir("/dev/pts")
    error = refused("up")
    assert "/dev/pts/runs: " in error
    assert "call roco in a folder that you may write to, or name one" in error


def test_a_file_in_place_of_a_folder_is_named(tmp_path: Path) -> None:
    """As the folder itself, and on the way to it."""
    file = tmp_path / "file\x1b]0;x\u202e"  # what a terminal would obey is shown
    file.touch()
    shown = str(file).replace("\x1b", "\\u001b").replace("\u202e", "\\u202e")
    places = {file: "it is a file; name a folder", file / "run": "a part of this path is a file"}
    for verb, (place, remedy) in product((("up", "--out"), ("keys", "make")), places.items()):
        error = refused(*verb, place)
        assert remedy in error, (verb, error)
        assert shown in error, (verb, error)


def called(
    words: list[str], out: TextIOWrapper, monkeypatch: pytest.MonkeyPatch
) -> tuple[object, str]:
    """Call `roco` in this process with this standard output; its exit code, and its words on
    standard error.
    """
    error = TextIOWrapper(BytesIO())
    monkeypatch.setattr(sys, "argv", ["roco", *words])
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", error)
    with pytest.raises(SystemExit) as ended:
        main()
    error.flush()
    return ended.value.code, error.buffer.getvalue().decode()  # type: ignore[attr-defined]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to be in, on a machine of which doctor looks at what is quick."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # which `roco` sets
    monkeypatch.setattr(checkup, "MACHINE", {"python": checkup.python, "disk": checkup.disk})
    monkeypatch.setattr("companion.tools.verbs.checkup.CHECKS", checkup.Checks())
    return tmp_path


def test_output_to_a_full_disk_is_told(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each verb ends as an error."""
    for words in VERBS:
        with Path("/dev/full").open("wb", buffering=0) as full:
            code, said = called(words, TextIOWrapper(full), monkeypatch)  # type: ignore[type-var]
        assert (code, "the disk is full: the output cannot be written" in said) == (1, True), (
            words,
            said,
        )


def test_output_to_a_full_disk_where_nobody_can_be_told_is_an_error(tmp_path: Path) -> None:
    """Standard error is there, too; the program itself."""
    with Path("/dev/full").open("wb") as full:
        done = process("design", "check", cwd=tmp_path, out=full.fileno())
        command = [sys.executable, "-P", "-m", "console", "design", "check"]
        mute = subprocess.run(
            command, cwd=tmp_path, stdout=full, stderr=full, timeout=50, check=False
        )
    assert (done.returncode, mute.returncode) == (1, 1)
    assert b"the disk is full: the output cannot be written" in done.stderr


def test_letters_that_a_terminal_lacks_are_escaped(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The verb does the same as elsewhere."""
    for words in VERBS:
        codes, texts = [], []
        for encoding in ("ascii", "utf-8"):
            (place := here / encoding).mkdir(exist_ok=True)
            monkeypatch.chdir(place)
            data = BytesIO()
            codes.append(called(words, TextIOWrapper(data, encoding=encoding), monkeypatch)[0])
            texts.append(data.getvalue())
        assert codes[0] == codes[1], words
        assert texts[0].isascii(), words
        assert texts[0], words


def test_json_for_such_a_terminal_means_the_same(tmp_path: Path) -> None:
    """An escape is that of JSON: halves of a pair beyond the first plane."""
    words = ("acl", "show", ACL, "--format", "json")
    there, here = (
        process(*words, cwd=tmp_path, PYTHONIOENCODING=one).stdout for one in ("ascii", "utf-8")
    )
    assert there.isascii()
    assert there != here
    assert json.loads(there) == json.loads(here)


def test_who_reads_no_further_is_told_nothing(tmp_path: Path) -> None:
    """A closed pipe is no error of the verb's."""
    reading, writing = os.pipe()
    os.close(reading)
    done = process("design", "show", "--format", "json", cwd=tmp_path, out=writing)
    os.close(writing)
    assert done.stderr == b""


def test_closed_output_is_as_an_empty_one(tmp_path: Path) -> None:
    """A shell closes it by >&-."""
    command = [sys.executable, "-P", "-m", "console", "design", "check"]
    closed = ["sh", "-c", 'exec "$@" >&-', "sh", *command]
    done = subprocess.run(closed, cwd=tmp_path, stderr=subprocess.PIPE, timeout=50, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_run_in_a_folder_that_is_not_utf_8_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files would name it, and so would Zenoh's configuration."""
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert "this path is not UTF-8; rename its folders, or name another path" in refused("up")
    assert not list(folder.iterdir())


def test_a_project_whose_path_has_a_colon_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """PYTHONPATH would have two folders of it, and each agent would be missing."""
    shutil.copytree(Path(__file__).parents[2] / "examples/depot", tmp_path / "a:b")
    monkeypatch.chdir(tmp_path / "a:b")
    assert "cannot be named in PYTHONPATH; rename the folder" in refused("up")
