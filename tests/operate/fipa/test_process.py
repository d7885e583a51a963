"""`roco fipa` as a process, over a real router, between doors of agents and a platform of our own
that speaks as JADE does: what is said gets there and back, also where the process is killed.
"""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from foreign_platform import Platform, platform, posted, wait_for
from https_site import keys, site
from process_house import SYSTEM, Agent, House, house_at

from agent_runtime.io.reaching import free_port
from companion.languages.cmd import TaskReport, TaskState
from companion.tasks.take.command import Take
from fipa_codec.acl_string import AclMessage, Aid, parse
from fipa_codec.envelope import unpack
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from operate.guests.fipa_http import Poster, mutual

pytestmark = [pytest.mark.zenoh, pytest.mark.process, pytest.mark.timeout(120)]
JAR = '{"type":"Take","object":"jar"}'
CMD = {"language": "CMD", "content": JAR}
DONE, CANCELLED = TaskReport(TaskState.DONE), TaskReport(TaskState.CANCELLED)


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    """One whose gateway a test starts."""
    with house_at(tmp_path) as made:
        yield made


@pytest.fixture
def lab() -> Iterator[Platform]:
    """Another platform."""
    with platform() as made:
        yield made


@pytest.fixture(scope="module")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[House]:
    """One that serves, for tests that leave it so."""
    with house_at(tmp_path_factory.mktemp("run")) as made:
        made.start("--agreed")
        yield made


def test_a_request_a_question_and_an_unknown_agent(serving: House, lab: Platform) -> None:
    """By JADE's text; each is answered in its conversation."""
    assert lab.say(P.REQUEST, serving.aid("hi"), "r1", **CMD) == 200
    wait_for(lambda: lab.acts("r1") == ["agree"], "hi agreed")
    assert serving.hi.asked[-1].content == Take(object="jar")
    serving.hi.door.say(serving.hi.asked[-1].conversation, P.INFORM, DONE)
    wait_for(lambda: lab.acts("r1") == ["agree", "inform"], "it is done")
    assert lab.say(
        P.QUERY_REF, serving.aid("km"), "q1", protocol="fipa-query", language="WM",
        content='{"type":"ListObjects"}',
    ) == 200  # fmt: skip
    wait_for(lambda: lab.acts("q1") == ["inform"], "km answered")
    assert lab.say(P.REQUEST, serving.aid("zz"), "u1", **CMD) == 200
    wait_for(lambda: lab.acts("u1") == ["failure"], "there is no such agent")
    assert "MTS-error" in str(lab.heard("u1")[0].content)


def test_a_cancel_by_the_openings_label(serving: House, lab: Platform) -> None:
    """And an agent that its platform does not know any more: its conversation is cancelled."""
    hi = serving.hi
    for name, agent in (("k1", "buyer"), ("k2", "gone")):
        assert lab.say(P.REQUEST, serving.aid("hi"), name, agent, **CMD) == 200
        wait_for(lambda name=name: lab.acts(name)[:1] == ["agree"], "hi agreed")
    wait_for(lambda: hi.asked[-1].content is None, "the conversation of who is gone is cancelled")
    label = lab.heard("k1")[0].in_reply_to
    assert lab.say(P.CANCEL, serving.aid("hi"), "k1", reply_with=label) == 200
    wait_for(lambda: [one.content for one in hi.asked[-2:]] == [None, None], "both are")
    assert hi.door.say(hi.asked[-1].conversation, P.INFORM, CANCELLED, Kind.CANCEL)
    wait_for(lambda: lab.acts("k1") == ["agree", "inform"], "the cancel is answered")
    assert lab.heard("k1")[1].in_reply_to == label


def test_a_gateway_that_is_killed_goes_on(house: House, lab: Platform) -> None:
    """What was said meanwhile is told once; what was posted twice was asked once."""
    hi = house.hi
    house.start("--agreed")
    for name in ("a", "b", "c"):
        assert lab.say(P.REQUEST, house.aid("hi"), name, reply_with=name, **CMD) == 200
        wait_for(lambda name=name: lab.acts(name) == ["agree"], "hi agreed")
    house.kill()
    a, b, c = (one.conversation for one in hi.asked)
    hi.door.say(a, P.INFORM, TaskReport(TaskState.RUNNING), Kind.PROGRESS)
    hi.door.say(a, P.INFORM, DONE)
    house.start("--agreed")
    wait_for(lambda: lab.acts("a") == ["agree", "inform"], "what was missed is told")
    assert lab.say(P.REQUEST, house.aid("hi"), "a", reply_with="a", **CMD) == 200
    assert lab.say(P.CANCEL, house.aid("hi"), "b", reply_with="b-k") == 200
    wait_for(lambda: hi.asked[-1].content is None, "hi is to cancel")
    house.kill()
    hi.door.say(b, P.INFORM, CANCELLED, Kind.CANCEL)
    hi.close()
    house.hi = Agent("hi", house.endpoint)
    assert house.hi.door.say(c, P.INFORM, DONE) is False
    house.start("--agreed")
    wait_for(lambda: lab.acts("c") == ["agree", "failure"], "hi began anew")
    assert lab.acts("b") == ["agree", "failure", "failure"]
    assert lab.acts("a") == ["agree", "inform"]
    assert [one.content is None for one in hi.asked] == [False, False, False, True]
    assert house.hi.asked == []


def test_a_platform_that_is_away_hears_later(house: House, lab: Platform) -> None:
    """Also where the gateway was killed meanwhile."""
    house.start("--agreed")
    assert lab.say(P.REQUEST, house.aid("hi"), "a", **CMD) == 200
    wait_for(lambda: lab.acts("a") == ["agree"], "hi agreed")
    lab.close()
    house.hi.door.say(house.hi.asked[0].conversation, P.INFORM, DONE)
    wait_for(lambda: "not delivered yet" in str(house.log()), "it was tried")
    house.kill()
    with platform(lab.port) as again:
        house.start("--agreed")
        wait_for(lambda: again.acts("a") == ["inform"], "it is told")


def test_our_agents_are_in_a_directory_as_long_as_it_runs(house: House, lab: Platform) -> None:
    """By JADE's contents; the answers are told."""
    lab.agents.add("df")
    name = "df@lab:1099/JADE"
    house.start("--df", f"{name}={lab.address}")
    wait_for(lambda: len(lab.all) == 2, "both are registered")
    hi = next(one for one in lab.all if "hi@" in str(one.content))
    assert (hi.language, hi.ontology) == ("fipa-sl0", "fipa-agent-management")
    assert str(hi.content).startswith(f"((action (agent-identifier :name {name}")
    assert f"(register (df-agent-description :name (agent-identifier :name hi@{SYSTEM}" in str(
        hi.content
    )
    answered: list[str] = []

    def answer(*asked: AclMessage) -> None:
        for one in asked:
            fields = {"in_reply_to": one.reply_with, "reply_with": None, "content": "((done ...))"}
            name = one.conversation_id or ""
            assert lab.say(P.INFORM, house.aid("hi"), name, "df", **fields) == 200
            answered.append(name)
        told = [one for one in house.log() if one.get("content") == "((done ...))"]
        assert len(told) == len(answered)

    answer(*lab.all)
    assert house.gateway is not None
    house.gateway.send_signal(signal.SIGTERM)
    wait_for(lambda: len(lab.all) == 4, "both are deregistered")
    assert all("(deregister (df-agent" in str(one.content) for one in lab.all[2:])
    answer(*lab.all[2:])
    assert house.gateway.wait(20.0) == 0, house.process_error.read_text()
    assert "no answer" not in str(house.log())


def test_what_needs_consent_is_refused_and_stop_says_what_it_cannot(
    house: House, lab: Platform
) -> None:
    """A gateway in a container of its own does not reach the robot, and says so."""
    house.start()
    assert lab.say(P.REQUEST, house.aid("hi"), "a", **CMD) == 200
    wait_for(lambda: lab.acts("a") == ["refuse"], "nobody agreed")
    assert lab.say(P.REQUEST, house.aid("hi"), "s", content="stop") == 200
    wait_for(lambda: lab.acts("s") == ["failure"], "it cannot stop the robot")
    assert "roco stop" in str(lab.heard("s")[0].content)
    assert house.hi.asked == []


def test_with_certificates_both_ways_are_https(house: House, tmp_path: Path) -> None:
    """A peer of the same authority is answered at its own HTTPS address, and no other is heard."""
    issuer = keys(tmp_path / "ours")
    keys(tmp_path / "theirs", issuer)
    keys(tmp_path / "others")
    house.scheme, house.place = "https", f"localhost:{free_port()}"
    house.start("--tls", str(tmp_path / "ours"), "--agreed")
    theirs = mutual(tmp_path / "theirs")
    with site(theirs) as peer:
        sender = Aid("buyer@far", (peer.url,))
        ask = AclMessage(
            performative=P.REQUEST, sender=sender, receiver=(house.aid("hi"),), reply_with="r",
            conversation_id="a", protocol="fipa-request", **CMD,
        )  # fmt: skip
        what, body = posted(ask, sender, ask.receiver)
        with pytest.raises(OSError, match="https"):
            asyncio.run(Poster(mutual(tmp_path / "others")).post((house.url,), what, body))
        asyncio.run(Poster(theirs).post((house.url,), what, body))
        wait_for(lambda: peer.taken, "the answer came")
        _, text = unpack(*peer.taken[0])
        assert parse(text).performative is P.AGREE
    assert len(house.hi.asked) == 1


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--at", "0.0.0.0:0"), "is not loopback: --tls"),
        (("--at", "here"), "expected host:port"),
        (("--tls", "/nowhere"), "certificate.pem"),
        (("--df", "df@lab"), "must be NAME=URL"),
        (("--df", "df@lab=http://192.0.2.1/acc"), "not on this machine"),
        (("--as", "assistant"), "platform"),
    ],
)
def test_what_cannot_be_is_said(house: House, words: tuple[str, ...], why: str) -> None:
    """With the way out, and the code of wrong use."""
    told = {"CONNECT": house.endpoint, "SYSTEM": SYSTEM, "RUN_DIR": str(house.run)}
    done = subprocess.run(
        [sys.executable, "-m", "console", "fipa", "--at", "127.0.0.1:0", *words],
        env=os.environ | {f"ROCO_{name}": value for name, value in told.items()},
        capture_output=True, text=True, timeout=60.0, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done
    assert why in " ".join(done.stderr.split())
