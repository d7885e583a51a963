"""`roco replay --replace`: a real agent, as a process, against the others as they were recorded."""

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from companion.languages import rc
from companion.tools.system import SYSTEM
from console.traffic.replace import Compared
from fipa_codec.communicate import encode
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Spoken

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(180)]
POUR = Path(__file__).parents[1] / "histories" / "pour_seed_7"


def replaced(file: Path, agent: str, code: int) -> Compared:
    """Return the agent's result; the exit code must be `code`."""
    words = f"-m console replay {file} --replace {agent} --speed max --format json"
    command = [sys.executable, *words.split()]
    done = subprocess.run(command, capture_output=True, timeout=150)
    assert done.returncode == code, done.stderr.decode()
    return msgspec.json.decode(done.stdout, type=Compared)


def elsewhere(record: Spoken) -> Spoken:
    """The same act with another point to look at."""
    one = record.communicate
    content = msgspec.msgpack.decode(one.content)
    content["at"][0][0] = 9.0
    wire = encode(
        msgspec.structs.replace(one, content=msgspec.Raw(msgspec.msgpack.encode(content)))
    )
    return msgspec.structs.replace(record, wire=wire, size=len(wire))


def test_an_agent_says_again_what_it_said() -> None:
    """All of it, though it runs in a second what took a minute and a half."""
    done = replaced(POUR, "km", 0)
    assert (done.spoken, done.lines, done.difference) == (118, 118, None)


def test_what_another_version_says_is_told() -> None:
    """The ta of the recording told nothing of its hands."""
    done = replaced(POUR, "ta", 1)
    assert done.difference is not None
    assert (done.lines, done.receiver) == (111, "co")
    different = done.difference
    assert (different.line, different.field) == (15, "content.hands")
    assert (different.recorded, different.now) == (None, {})


def test_it_is_said_where_the_words_first_differ(tmp_path: Path) -> None:
    """A recording in which ta asks for another act than it does: the line, the field, both words;
    exit code 1.
    """
    file, changed = tmp_path / "other.mcap", False
    copy = mcap_file.Recording(file)
    for record in mcap_file.read(POUR / TRAFFIC_FILE, SYSTEM).records:
        if isinstance(record, Spoken) and isinstance(record.content, rc.Look) and not changed:
            record, changed = elsewhere(record), True
        copy.add(record)
    copy.finish()
    assert changed
    done = replaced(file, "ta", 1)
    assert done.difference is not None
    assert (done.receiver, done.performative) == ("ex", "request")
    assert (done.difference.field, done.difference.recorded) == ("content.at[0][0]", 9.0)
    assert done.difference.now != 9.0
