"""`roco view --ros` over a real router: a node of ROS 2 in rmw_zenoh's format, read by a second
library and byte by byte.
"""

import importlib.util
import json
import re
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
import zenoh.ext
from test_foxglove import SAID, last
from test_traffic import Router, refused
from toy_fleet import wait_for

from agent_runtime.core.wiring import service_key
from agent_runtime.io.reaching import free_port
from agent_runtime.io.run_files import STOP_FILE
from agent_runtime.io.sessions import client_config
from companion.run_files import HELD
from companion.telemetry import RobotState, TrueState
from operate.ros.messages import COMMUNICATE, TRIGGER_HASH, TYPES, definition
from velma.names import BODY

pytestmark = pytest.mark.zenoh
READER = Path(__file__).with_name("ros_reader.py")
JOINTS, STRING = "sensor_msgs/msg/JointState", "std_msgs/msg/String"
HASH = re.compile("RIHS01_[0-9a-f]{64}")
ATTACHMENT = struct.Struct("<qqB16s")
STOP = f"0/stop/std_srvs::srv::dds_::Trigger_/{TRIGGER_HASH}"


class Node:
    """A router at which somebody speaks, `roco view --ros` beside it, and a session at ROS's
    router.
    """

    def __init__(self, router: Router) -> None:
        self.router, self.port = router, free_port()
        words = f"view --ros --at 127.0.0.1:{self.port} --format json"
        self.process = router.roco(words)
        assert self.process.stdout is not None
        self.told = json.loads(self.process.stdout.readline())
        self.session = zenoh.open(client_config(self.told["router"], timestamping=True))

    def tell(self, kind: type) -> Any:
        """A signal of the robot, as its loop tells it."""
        one, what = last(kind)
        self.router.session.put(service_key("roco", one.kind, one.owner), one.data)
        return what

    def tokens(self) -> list[str]:
        replies = self.session.liveliness().get("@ros2_lv/0/**")
        return [str(one.ok.key_expr) for one in replies if one.ok is not None]

    def named(self) -> None:
        """Wait until it has named its topics."""
        wait_for(lambda: any("%room%image%compressed" in one for one in self.tokens()), "topics")


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Node]:
    """It serves, and nothing was said yet."""
    router = Router(tmp_path)
    made = Node(router)
    yield made
    made.session.close()  # type: ignore[no-untyped-call]
    router.close()


def test_keys_tokens_and_attachments_are_those_of_rmw_zenoh(node: Node) -> None:
    """One node with an entity for each topic and service; a message with number, time and gid; what
    is latched comes to late subscribers.
    """
    node.named()
    assert node.told["own"]
    tokens = [one.split("/") for one in node.tokens()]
    (own,) = (one for one in tokens if one[5] == "NN")
    assert own[6:] == ["%", "%", "roco"]
    assert own[3] == own[4]
    entities = {one[9]: one for one in tokens if one[5] != "NN"}
    assert len({one[4] for one in entities.values()}) == len(entities)
    assert {one[5] for name, one in entities.items() if name != "%stop"} == {"MP"}
    assert entities["%stop"][5] == "SS"
    assert all(HASH.fullmatch(one[11]) for one in entities.values())
    dds, _, qos = entities["%joint_states"][10:]
    assert (dds, qos) == ("sensor_msgs::msg::dds_::JointState_", "::,10:,:,:,,")
    assert entities["%robot_description"][12] == ":1:,1:,:,:,,"

    heard: list[zenoh.Sample] = []
    sub = node.session.declare_subscriber(f"0/joint_states/{dds}/*", heard.append)
    wait_for(lambda: node.tell(RobotState) and len(heard) >= 2, "joint states")
    first, second = (ATTACHMENT.unpack(one.attachment.to_bytes()) for one in heard[:2])
    assert (second[0] - first[0], first[2], first[3]) == (1, 16, second[3])
    assert abs(first[1] / 1e9 - time.time()) < 60
    _, state = last(RobotState)
    told = TYPES.deserialize_cdr(heard[0].payload.to_bytes(), JOINTS)
    positions = dict(zip(told.name, told.position, strict=True))
    np.testing.assert_array_equal([positions[name] for name in BODY], state.body)
    sub.undeclare()

    late: list[zenoh.Sample] = []
    history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
    key = "0/robot_description/std_msgs::msg::dds_::String_/*"
    again = zenoh.ext.declare_advanced_subscriber(node.session, key, late.append, history=history)
    wait_for(lambda: late, "the model")
    assert "<robot" in TYPES.deserialize_cdr(late[0].payload.to_bytes(), STRING).data
    again.undeclare()
    node.process.send_signal(2)
    assert node.process.wait(20) == 0


def test_stop_stops_and_nothing_else_comes_in(node: Node) -> None:
    """As `roco stop`; who calls gets the number of the call. What is put on its topics, and a call
    without an attachment, do nothing; the fleet hears nothing of it.
    """
    heard: list[str] = []
    everything = node.router.session.declare_subscriber(
        "**", lambda sample: heard.append(str(sample.key_expr))
    )
    node.named()
    flag = node.router.run / STOP_FILE
    assert list(node.session.get(STOP, payload=b"", timeout=0.5)) == []
    node.session.put("0/joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_0", b"")
    node.session.put("roco/roco/C2/hi/co/request/request", b"")
    assert not flag.exists()
    (reply,) = node.session.get(
        STOP, payload=b"\x00\x01\x00\x00\x00", attachment=ATTACHMENT.pack(41, 1, 16, b"g" * 16)
    )
    assert reply.ok is not None
    number, _, size, gid = ATTACHMENT.unpack(reply.ok.attachment.to_bytes())
    assert (number, size, gid) == (41, 16, b"g" * 16)
    answer = reply.ok.payload.to_bytes()
    told = TYPES.deserialize_cdr(answer, "std_srvs/srv/msg/Trigger_Response")
    assert (told.success, told.message) == (True, HELD)
    assert flag.read_bytes()[:1] == b"\x01"
    assert heard == []
    everything.undeclare()


def test_a_router_that_is_there_is_used(node: Node) -> None:
    """That of ROS itself, say; where something else listens, it is told."""
    second = node.router.begin(
        f"view --ros --at 127.0.0.1:{node.port} --format json", *node.router.about
    )
    assert second.stdout is not None
    assert not json.loads(second.stdout.readline())["own"]
    for words, why in (
        ("--at 0.0.0.0:7447", "this machine alone"),
        ("--foxglove", "a running fleet alone"),
    ):
        refused(node.router.begin(f"view --ros {words}", *node.router.about), 2, why)
    node.router.environment["ROS_DOMAIN_ID"] = "300"
    refused(node.router.begin("view --ros", *node.router.about), 2, "0 to 232")


def written(folder: Path, *kinds: str) -> None:
    """Write the definitions of types, with those that they use, as packages have them."""
    for kind in kinds:
        first, *others = re.split(r"^=+\nMSG: (.*)\n", definition(kind), flags=re.MULTILINE)
        named = {kind: first} | dict(zip(others[::2], others[1::2], strict=True))
        for name, text in named.items():
            package, *_, short = name.split("/")
            file = folder / package / "msg" / f"{short}.msg"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)


@pytest.mark.skipif(
    importlib.util.find_spec("zenoh_ros2_sdk") is None,
    reason="needs zenoh-ros2-sdk (PyPI: pip install zenoh-ros2-sdk)",
)
def test_a_second_library_reads_it(node: Node, tmp_path: Path) -> None:
    """It has encoder, tokens and hashes of its own, and the definitions as files."""
    written(tmp_path / "types", JOINTS, STRING, COMMUNICATE)
    node.named()
    pipe = subprocess.PIPE
    command = [sys.executable, READER, tmp_path / "types", str(node.port)]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as reader:
        try:
            assert reader.stdout is not None
            lines = (json.loads(line) for line in reader.stdout if line.startswith("{"))
            node.tell(TrueState)
            _, state = last(RobotState)
            topics = next(lines)["topics"]
            assert topics["/joint_states"] == [JOINTS]
            assert topics["/tf"] == ["tf2_msgs/msg/TFMessage"]
            assert topics["/communicates/C3"] == [COMMUNICATE]
            found: dict[str, Any] = {}
            for one in lines:
                if one.get("ready"):
                    node.tell(RobotState)
                    node.router.say(SAID)
                else:
                    found.setdefault(one["topic"], one)
                if found.keys() >= {"/joint_states", "/robot_description", "/communicates/C3"}:
                    break
        finally:
            reader.kill()
    assert {*state.body} <= {*found["/joint_states"]["position"]}
    assert "<robot" in found["/robot_description"]["data"]
    assert found["/communicates/C3"]["sender"] == "co"
    assert found["/communicates/C3"]["performative"] == "request"
