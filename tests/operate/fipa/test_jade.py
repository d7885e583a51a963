"""The real platform before `roco fipa`: agents of JADE 4.6.5, and its directory. Where
ROCO_JADE_JAR names its jar; docs/jade.md says how to get one.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from foreign_platform import wait_for
from process_house import SYSTEM, House, house_at

from agent_runtime.io.reaching import free_port
from companion.languages.cmd import TaskReport, TaskState
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P

JAR = os.environ.get("ROCO_JADE_JAR", "")
pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.process,
    pytest.mark.timeout(180),
    pytest.mark.skipif(
        not (Path(JAR).is_file() and shutil.which("javac")),
        reason="needs JADE 4.6.5 (jade.tilab.com: ROCO_JADE_JAR names its jar) and javac (Debian:"
        " apt install default-jdk-headless)",
    ),
]
TASK = {"ACT": "REQUEST", "PROTOCOL": "fipa-request", "LANGUAGE": "CMD"}
TASK |= {"CONTENT": '{"type":"Take","object":"jar"}'}
QUESTION = {"ACT": "QUERY-REF", "PROTOCOL": "fipa-query", "LANGUAGE": "WM"}
QUESTION |= {"CONTENT": '{"type":"ListObjects"}'}
DONE, CANCELLED = TaskReport(TaskState.DONE), TaskReport(TaskState.CANCELLED)


@pytest.fixture(scope="module")
def classes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The agent that asks, compiled."""
    folder = tmp_path_factory.mktemp("classes")
    source = Path(__file__).with_name("Asker.java")
    subprocess.run(["javac", "-cp", JAR, "-d", folder, source], check=True, timeout=120.0)
    return folder


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    with house_at(tmp_path_factory.mktemp("run")) as made:
        made.start("--agreed")
        yield made


class Jade:
    """A platform with an agent that asks; `address` of its transport."""

    def __init__(self, classes: Path, folder: Path, asks: dict[str, str]) -> None:
        self._file = folder / "jade.out"
        self.address = f"http://127.0.0.1:{free_port()}/acc"
        command = [
            "java", "-cp", f"{JAR}:{classes}", "jade.Boot",
            "-local-host", "127.0.0.1", "-local-port", str(free_port()),
            "-mtps", f"jade.mtp.http.MessageTransportProtocol({self.address})",
            "-agents", "asker:Asker",
        ]  # fmt: skip
        told = {f"ASK_{name}": value for name, value in asks.items()}
        with self._file.open("w") as out:
            self._process = subprocess.Popen(
                command, cwd=folder, env=os.environ | told, stdout=out, stderr=out
            )

    def lines(self, begin: str) -> list[str]:
        """What its agent printed that begins so."""
        lines = self._file.read_text().splitlines()
        return [one.removeprefix(begin) for one in lines if one.startswith(begin)]

    def told(self) -> list[str]:
        """The acts that its agent was told."""
        return [one.split(" ")[0] for one in self.lines("TOLD ")]

    def wait(self, *acts: str) -> None:
        """Until its agent was told these."""
        try:
            wait_for(lambda: self.told() == list(acts), f"JADE's agent was told {acts}")
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self._file.read_text()}") from None

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait(20.0)


@contextmanager
def jade(classes: Path, folder: Path, **asks: str) -> Iterator[Jade]:
    """One that ends."""
    made = Jade(classes, folder, asks)
    try:
        yield made
    finally:
        made.close()


def to(house: House, agent: str) -> dict[str, str]:
    """Whom to ask."""
    return {"TO": f"{agent}@{SYSTEM}", "ADDRESS": house.url}


def test_a_request(house: House, classes: Path, tmp_path: Path) -> None:
    """Agree, then the result."""
    with jade(classes, tmp_path, **TASK, **to(house, "hi")) as platform:
        platform.wait("agree")
        house.hi.door.say(house.hi.asked[-1].conversation, P.INFORM, DONE)
        platform.wait("agree", "inform")


def test_a_cancel(house: House, classes: Path, tmp_path: Path) -> None:
    """Answered by the cancel's label."""
    with jade(classes, tmp_path, **TASK, **to(house, "hi"), CANCEL="1") as platform:
        platform.wait("agree")
        wait_for(lambda: house.hi.asked[-1].content is None, "hi is to cancel")
        house.hi.door.say(house.hi.asked[-1].conversation, P.INFORM, CANCELLED, Kind.CANCEL)
        platform.wait("agree", "inform")
        assert platform.lines("TOLD ")[1].split(" ")[1] == "to-cancel"


def test_a_question(house: House, classes: Path, tmp_path: Path) -> None:
    """Answered at once."""
    with jade(classes, tmp_path, **QUESTION, **to(house, "km")) as platform:
        platform.wait("inform")


def test_bad_content(house: House, classes: Path, tmp_path: Path) -> None:
    """Not understood."""
    bad = TASK | {"CONTENT": "take the jar"}
    with jade(classes, tmp_path, **bad, **to(house, "hi")) as platform:
        platform.wait("not-understood")


def test_an_unknown_agent(house: House, classes: Path, tmp_path: Path) -> None:
    """Our AMS tells."""
    with jade(classes, tmp_path, **TASK, **to(house, "zz")) as platform:
        platform.wait("failure")


def test_an_agent_that_is_gone(house: House, classes: Path, tmp_path: Path) -> None:
    """Its platform's MTS-error, or that nobody is there, ends its conversation at our agent."""
    with jade(classes, tmp_path, **TASK, **to(house, "hi")) as platform:
        platform.wait("agree")
    house.hi.door.say(house.hi.asked[-1].conversation, P.INFORM, TaskReport(TaskState.FAILED))
    wait_for(lambda: "not delivered yet" in str(house.log()), "it was tried")


def test_its_directory(classes: Path, tmp_path: Path) -> None:
    """Our agents are registered, and deregistered at the end."""
    with jade(classes, tmp_path) as platform, house_at(tmp_path) as house:
        wait_for(lambda: platform.lines("PLATFORM "), "it is up")
        (name,) = platform.lines("PLATFORM ")
        house.start("--df", f"df@{name}={platform.address}")

        def answers(what: str) -> list[object]:
            return [one["act"] for one in house.log() if one.get("what") == what]

        wait_for(lambda: answers("register") == ["inform"] * 2, "both are registered")
        assert house.gateway is not None
        house.gateway.terminate()
        wait_for(lambda: answers("deregister") == ["inform"] * 2, "both are deregistered")
