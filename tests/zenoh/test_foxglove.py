"""`roco view --foxglove` over a real router: what is heard of a fleet is read by a client of
Foxglove's protocol, and nothing comes in.
"""

import ipaddress
import json
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import msgspec
import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from test_traffic import POUR, Router, refused
from toy_fleet import wait_for
from websockets.sync.client import connect

from agent_runtime.core.wiring import service_key
from companion.telemetry import RobotState, TrueState
from companion.tools.telemetry import DECODERS
from console.errors import UsageError
from console.fleet import interfaces, live_ros
from console.fleet.local import Local
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import House
from operate.ros.messages import TYPES
from velma.names import BODY

pytestmark = pytest.mark.zenoh
PROTOCOL = "foxglove.sdk.v1"
DATA, SAID = 1, 40
"""First byte of a message of the server; communicates that are said."""
SIGNALS = [one for one in mcap_file.read(POUR / TRAFFIC_FILE).records if isinstance(one, House)]
"""Those of the recorded run."""


def last(kind: type) -> tuple[House, Any]:
    """The last signal of this kind: as it was heard, and what it says."""
    for one in reversed(SIGNALS):
        if one.kind in DECODERS and isinstance(what := DECODERS[one.kind](one.data), kind):
            return one, what
    raise AssertionError(kind)


class Viewer:
    """A client of Foxglove's server that wants all that is advertised."""

    def __init__(self, url: str) -> None:
        self._connected = ExitStack()
        self.socket = self._connected.enter_context(
            connect(url, subprotocols=[PROTOCOL], max_size=None)
        )
        self.channels: dict[str, dict[str, Any]] = {}
        self.status: list[dict[str, Any]] = []
        self.server: dict[str, Any] = {}
        self.data: dict[str, list[bytes]] = {}

    def close(self) -> None:
        """Leave."""
        self._connected.close()

    def read(self, timeout_s: float = 0.2) -> bool:
        """Take one message of the server; False where none comes in time."""
        try:
            one = self.socket.recv(timeout=timeout_s)
        except TimeoutError:
            return False
        if isinstance(one, bytes):
            topics = {channel["id"]: topic for topic, channel in self.channels.items()}
            kind, subscription, _ = struct.unpack_from("<BIQ", one)
            assert kind == DATA
            self.data.setdefault(topics[subscription], []).append(one[13:])
            return True
        said = json.loads(one)
        match said["op"]:
            case "serverInfo":
                self.server = said
            case "advertise":
                self.channels |= {channel["topic"]: channel for channel in said["channels"]}
                wanted = [{"id": c["id"], "channelId": c["id"]} for c in said["channels"]]
                self.say({"op": "subscribe", "subscriptions": wanted})
            case _:
                self.status.append(said)
        return True

    def say(self, what: dict[str, Any] | bytes) -> None:
        self.socket.send(what if isinstance(what, bytes) else json.dumps(what))

    def has(self, *topics: str) -> bool:
        """Whether something came on all of these."""
        self.read()
        return self.data.keys() >= {*topics}

    def ros(self, topic: str) -> list[Any]:
        """What came on a topic, decoded from CDR."""
        kind = self.channels[topic]["schemaName"]
        return [TYPES.deserialize_cdr(data, kind) for data in self.data[topic]]

    def own(self, topic: str) -> list[Any]:
        """What came on a topic in one of Foxglove's own types."""
        channel = self.channels[topic]
        assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
        pool = descriptor_pool.DescriptorPool()
        files = descriptor_pb2.FileDescriptorSet()
        files.ParseFromString(msgspec.json.decode(f'"{channel["schema"]}"', type=bytes))
        for file in files.file:
            pool.Add(file)
        kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
        return [kind.FromString(data) for data in self.data[topic]]


class Served:
    """A router at which somebody speaks, and `roco view --foxglove` beside it."""

    def __init__(self, router: Router) -> None:
        self.router = router
        self.process = router.roco("view --foxglove --format json")
        assert self.process.stdout is not None
        self.url = json.loads(self.process.stdout.readline())["url"]
        self.viewers: list[Viewer] = []

    def viewer(self) -> Viewer:
        """One more."""
        self.viewers.append(Viewer(self.url))
        return self.viewers[-1]

    def tell(self, *signals: House) -> None:
        """Signals of the robot, as its loop tells them."""
        for one in signals:
            self.router.session.put(service_key("roco", one.kind, one.owner), one.data)


@pytest.fixture
def served(tmp_path: Any) -> Iterator[Served]:
    """It serves, and nothing was said yet."""
    router = Router(tmp_path)
    made = Served(router)
    yield made
    for viewer in made.viewers:
        viewer.close()
    router.close()


TOPICS = ("/joint_states", "/tf", "/communicates/C3", "/foxglove/log")
LATCHED = ("/robot_description", "/tf_static", "/objects", "/foxglove/objects", "/grains")


def test_a_viewer_gets_what_was_meant(served: Served) -> None:
    """Also who comes later, of what is told once; types with their definitions."""
    robot, state = last(RobotState)
    truth, true = last(TrueState)
    first = served.viewer()
    wait_for(lambda: not first.read() and "/tf" in first.channels, "topics are named")
    served.tell(truth, robot)
    wait_for(lambda: first.has("/joint_states", "/objects"), "all was told")
    viewer = served.viewer()
    wait_for(lambda: viewer.has(*LATCHED), "what was told before the viewer came")
    served.tell(truth, robot)
    served.router.say(SAID)
    wait_for(lambda: viewer.has(*TOPICS), "what is told now")
    said = [one for one in served.router.said if one.channel == "C3"]
    wait_for(lambda: not viewer.read() and len(viewer.data["/communicates/C3"]) == len(said), "all")

    schema = viewer.channels["/joint_states"]
    assert (schema["encoding"], schema["schemaEncoding"]) == ("cdr", "ros2msg")
    assert "float64[] position" in schema["schema"]
    joints = viewer.ros("/joint_states")[-1]
    positions = dict(zip(joints.name, joints.position, strict=True))
    np.testing.assert_array_equal([positions[name] for name in BODY], state.body)
    assert "<robot" in viewer.ros("/robot_description")[-1].data
    frames = {
        one.child_frame_id: one.transform.translation
        for told in viewer.ros("/tf")
        for one in told.transforms
    }
    for name, pose in true.poses.items():
        at = frames[name]
        assert (at.x, at.y, at.z) == pytest.approx(pose.xyz)
    for one, message in zip(said, viewer.ros("/communicates/C3"), strict=True):
        assert (message.sender, message.performative) == (one.sender, one.performative)
        assert message.verdict == "legal"
        assert json.loads(message.content)["type"]

    looks = viewer.ros("/objects")[-1].markers[1:]
    scene = viewer.own("/foxglove/objects")[-1]
    assert [(one.frame_id, one.id) for one in scene.entities] == [
        (look.header.frame_id, f"{look.ns}/{look.id}") for look in looks
    ]
    for one, look in zip(scene.entities, looks, strict=True):
        (shape,) = (*one.cubes, *one.spheres, *one.cylinders, *one.triangles)
        assert shape.pose.position.x == look.pose.position.x
        assert shape.color.g == pytest.approx(look.color.g)
        assert len(getattr(shape, "points", ())) == len(look.points)
    lines = [one.message for one in viewer.own("/foxglove/log")]
    assert any("co > pl  request" in line for line in lines)
    served.process.send_signal(2)
    assert served.process.wait(20) == 0


def test_who_looks_for_open_interfaces_is_told_it_while_it_is_served(served: Served) -> None:
    """Also not where it was killed and its file is left."""
    fleet = Local(served.router.run)
    wait_for(lambda: served.url in live_ros.viewed(fleet, "Foxglove"), "it is told")
    assert [name for name, _ in interfaces.opened(fleet)][-1] == "open: Foxglove"
    served.process.kill()
    served.process.wait(20)
    assert (served.router.run / live_ros.VIEWED_FILES["Foxglove"]).exists()
    assert not live_ros.viewed(fleet, "Foxglove")


def test_nothing_comes_in(served: Served) -> None:
    """No capability is offered, and each attempt is refused by the library; the fleet hears
    nothing.
    """
    heard: list[str] = []
    own = service_key("roco", "telemetry", "ex")
    everything = served.router.session.declare_subscriber(
        "**", lambda sample: heard.append(str(sample.key_expr))
    )
    viewer = served.viewer()
    wait_for(lambda: viewer.read() and viewer.server, "the server tells what it can")
    assert viewer.server["capabilities"] == []
    topic = {"id": 1, "topic": "/stop", "encoding": "json", "schemaName": ""}
    viewer.say({"op": "advertise", "channels": [topic]})
    viewer.say(b"\x01" + struct.pack("<I", 1) + b"{}")
    viewer.say({"op": "setParameters", "parameters": [{"name": "a", "value": 1}]})
    viewer.say(b"\x02" + struct.pack("<III", 1, 1, 4) + b"json{}")
    viewer.say({"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1})
    wait_for(lambda: not viewer.read() and len(viewer.status) >= 4, "all is answered")
    for one in viewer.status:
        assert one["op"] == "serviceCallFailure" or one.get("level") == 2 or one["status"] == 1
    robot, _ = last(RobotState)
    served.tell(robot)
    wait_for(lambda: heard, "what is put is heard")
    assert {*heard} == {own}
    everything.undeclare()


def test_it_serves_this_machine_alone(served: Served, tmp_path: Any) -> None:
    """At an address that nobody names by chance; an address of others is refused."""
    host, _, port = served.url.removeprefix("ws://").rpartition(":")
    assert ipaddress.IPv4Address(host).is_loopback
    assert len({live_ros.place("")[0] for _ in range(50)}) > 40
    for wrong in ("0.0.0.0:8765", "192.168.1.2:8765", "127.0.0.1", "127.0.0.1:70000", "[::]:1"):
        with pytest.raises(UsageError, match="this machine alone"):
            live_ros.place(wrong)
    words = ("view --foxglove --at", f"{host}:{port}", *served.router.about)
    refused(served.router.begin(*words), 1, "nothing can be served at")


def test_without_the_library_the_extra_is_named(tmp_path: Any) -> None:
    """Exit code 1, and how to get it."""
    router = Router(tmp_path)
    lacking = tmp_path / "lacking"
    lacking.mkdir()
    (lacking / "foxglove.py").write_text(
        "raise ModuleNotFoundError(\"No module named 'foxglove'\", name='foxglove')\n"
    )
    router.environment["PYTHONPATH"] = os.pathsep.join((str(lacking), *sys.path))
    how = "foxglove is not installed here: pip install 'robot-companion[foxglove]'"
    refused(router.begin("view --foxglove", *router.about), 1, how)
    router.close()
