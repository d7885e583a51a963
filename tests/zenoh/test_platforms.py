"""`roco fipa` before a whole fleet: a platform of our own that speaks as JADE does has a task done,
over a kill of the gateway, all of it judged and recorded; and it stops the robot.
"""

import json
import subprocess
from collections.abc import Iterator

import pytest
from foreign_platform import Platform, platform
from roco_fleet import RocoFleet
from toy_fleet import wait_for

from console.fleet.platforms import WAY
from fipa_codec.acl_string import Aid
from fipa_codec.performatives import Performative as P

pytestmark = [pytest.mark.zenoh, pytest.mark.process, pytest.mark.timeout(300)]
TASK_S = 150.0


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RocoFleet]:
    made = RocoFleet(tmp_path_factory.mktemp("site") / "run")
    yield made
    made.down()


@pytest.fixture
def lab() -> Iterator[Platform]:
    """Another platform."""
    with platform() as made:
        yield made


def verdicts(fleet: RocoFleet) -> list[dict[str, str]]:
    """What the judge said of the guest's words, and of those to it."""
    lines = (fleet.run / "verdicts.jsonl").read_bytes().splitlines()
    told = [json.loads(line) for line in lines if b"platform" in line]
    return [one for one in told if "platform" in (one.get("sender"), one.get("receiver"))]


def test_a_task_is_done_over_a_kill_of_the_gateway_and_stop_stops(
    fleet: RocoFleet, lab: Platform
) -> None:
    """People see it, doctor tells where it is open, and the recording has it as legal."""
    at = "127.0.0.1:0"

    def serve() -> str:
        file = fleet.run / WAY.address_file
        file.unlink(missing_ok=True)
        started.append(fleet.begin("fipa", "--at", at, "--agreed"))
        wait_for(lambda: file.exists() or started[-1].poll() is not None, "it serves")
        return str(json.loads(file.read_bytes())["url"])

    look = f"look-{lab.port}"  # a second try is another conversation
    started: list[subprocess.Popen[bytes]] = []
    url = serve()
    at = url.removeprefix("http://").removesuffix("/acc")
    told = json.loads((fleet.run / "fleet.json").read_bytes())
    hi, km = (Aid(f"{name}@{told['system']}", (url,)) for name in ("hi", "km"))
    try:
        wish = {"language": "CMD", "content": '{"type":"LookAround"}'}
        assert lab.say(P.REQUEST, hi, look, **wish) == 200
        wait_for(lambda: lab.acts(look) == ["agree"], "hi agreed")
        started[-1].kill()
        started[-1].communicate()
        assert serve() == url
        fleet.wait(lambda: len(lab.heard(look)) == 2, "it has ended", TASK_S)
        assert lab.acts(look) == ["agree", "inform"]
        assert json.loads(str(lab.heard(look)[1].content))["state"] == "done"
        assert fleet.hi.tasks()[-1].said == "platform: look around"
        query = {"language": "WM", "content": '{"type":"ListObjects"}', "protocol": "fipa-query"}
        assert lab.say(P.QUERY_REF, km, "list", **query) == 200
        wait_for(lambda: lab.acts("list") == ["inform"], "km answered")
        assert "jar_1" in str(lab.heard("list")[0].content)
        assert f"served at {url}" in fleet.roco("doctor")
        assert lab.say(P.REQUEST, hi, "stop", content="stop", language="fipa-sl") == 200
        wait_for(lambda: lab.acts("stop") == ["inform"], "the robot is stopped")
        assert (fleet.run / "stop").read_bytes()[:1] == b"\x01"
        wait_for(lambda: len(verdicts(fleet)) >= 5, "the judge heard it")
        assert {one["verdict"] for one in verdicts(fleet)} == {"legal"}
    finally:
        started[-1].terminate()
        started[-1].communicate(timeout=20.0)
    assert not (fleet.run / WAY.address_file).exists()
