"""A run as a rosbag2: third-party programs read in it what the run holds."""

import base64
import json
import os
import platform
import re
import subprocess
import sys
from collections import Counter
from dataclasses import fields, is_dataclass
from pathlib import Path

import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from planting import POUR
from rerun.urdf import UrdfTree
from rosbags.rosbag2 import Reader
from synthetic import with_signals, with_truth
from typer.testing import CliRunner

from companion.languages import wm
from companion.telemetry import Picture, RobotState, TrueState
from companion.tools import ros, telemetry
from console.__main__ import app
from operate.recording.happenings import of_history
from operate.recording.history import Entered, History
from operate.recording.records import House
from operate.recording.run import Run
from operate.ros import bag, messages
from operate.verdict_lines import Judged
from velma.kinematics.robot import Robot
from velma.names import BODY, GRIP_BODY

ROOT = Path(__file__).parents[3]
UV = Path(sys.executable).with_name("uv")
RERUN = Path(sys.executable).with_name("rerun")
CLOSE = 1e-9
JPEG, ROOM = b"\xff\xd8head\xff\xd9", b"\xff\xd8room\xff\xd9"
AGAINST = "an answer to nothing"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The recorded pour, with what this old recording lacks: a picture, a log, something against
    the design, an agent that is gone.
    """
    place = tmp_path_factory.mktemp("run")
    (place / "logs").mkdir()
    lines = [
        {"agent": "km", "t": 1.5e9, "level": "warning", "event": "slow", "ms": 7},
        {"not": "a line"},
    ]
    log = b"\n".join([*map(msgspec.json.encode, lines), b"{cut off"])
    (place / "logs" / "km.jsonl").write_bytes(log)
    recorded = Run(POUR)
    past, found = recorded.history, Run(place, recorded.system)
    at = past.signals.houses[-1].received
    picture = House("telemetry", "ex", "", at, msgspec.msgpack.encode(Picture(1.0, JPEG, ROOM)))
    wrong = Judged(at, "unforeseen", 9, "C4", "pl", "km", why=AGAINST, violation=True)
    found.history = msgspec.structs.replace(
        with_signals(past, *past.signals.houses, picture),
        judged=(*past.judged, wrong),
        entered=(*past.entered, Entered(past.entered[-1].at, "pl", "searching", alive=False)),
    )
    return found


@pytest.fixture(scope="module")
def past(run) -> History:
    return run.history


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    """The bag's folder, and its topics as they were told."""
    folder = tmp_path_factory.mktemp("bags") / "pour"
    return folder, bag.write(folder, bag.entries(run))


@pytest.fixture(scope="module")
def read(written):
    """Topic -> its messages with their log times [ns], as mcap-ros2-support reads them."""
    found: dict[str, list] = {}
    with (written[0] / "pour.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, one, told in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((one.log_time, told))
    return found


def test_every_topic_is_read_with_as_many_messages(written, read, past):
    """And each state, truth and communicate of the run is there."""
    told = {one.topic: one.messages for one in written[1]}
    assert {topic: len(some) for topic, some in read.items()} == told
    assert len(read["/joint_states"]) == len(telemetry.every(past, RobotState))
    said = Counter(one.channel for one in past.said)
    assert {f"/communicates/{name}": count for name, count in said.items()} == {
        topic: count for topic, count in told.items() if topic.startswith("/communicates/")
    }
    times = [at for some in read.values() for at, _ in some]
    assert min(times) > 1e18
    assert all(some == sorted(some, key=lambda one: one[0]) for some in read.values())


def test_a_communicate_has_its_fields_and_its_content(read, past):
    """Those of the wire; the content as JSON; what the judge says."""
    verdicts = {((one.sender, one.receiver, one.id), one.t): one.verdict for one in past.judged}
    for channel in {one.channel for one in past.said}:
        said = [one for one in past.said if one.channel == channel]
        for one, (at, told) in zip(said, read[f"/communicates/{channel}"], strict=True):
            assert at == pytest.approx(one.received * 1e9, abs=1e3)
            wire = one.communicate
            same = ("sender", "receiver", "protocol", "language", "ontology", "in_reply_to")
            assert [getattr(told, name) for name in same] == [getattr(wire, name) for name in same]
            assert told.performative == one.performative
            assert (told.conversation_id, told.id) == (one.conversation, one.id)
            assert (told.size, told.text, told.channel) == (one.size, one.text, channel)
            assert told.verdict == verdicts[one.identity, one.received]
            assert told.sent.sec + told.sent.nanosec / 1e9 == pytest.approx(one.sent)
            if wire.content is not msgspec.UNSET:
                assert json.loads(told.content) == msgspec.msgpack.decode(wire.content)


def frames_at(read, at):
    """Frame -> (its parent, T_parent_frame), as they were told last at a time [ns]."""
    found = {}
    for topic in ("/tf_static", "/tf"):
        for when, told in read[topic]:
            for one in told.transforms if when <= at else ():
                found[one.child_frame_id] = (one.header.frame_id, matrix(one.transform))
    return found


def matrix(told):
    """Homogeneous, of a geometry_msgs/Transform."""
    x, y, z, w = (getattr(told.rotation, name) for name in "xyzw")
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = [getattr(told.translation, name) for name in "xyz"]
    return out


def in_world(frames, name):
    out = np.eye(4)
    while name != "world":
        name, step = frames[name]
        out = step @ out
    return out


def test_hands_are_where_pinocchio_says_and_things_where_they_truly_were(read, past):
    """By the tree of frames, at the last state of the robot."""
    (at, state), velma = telemetry.every(past, RobotState)[-1], Robot()
    ns, joints = read["/joint_states"][-1]
    assert ns == pytest.approx(at * 1e9, abs=1e3)
    q = dict(zip(joints.name, joints.position, strict=True))
    assert [q[name] for name in BODY] == list(state.body)
    frames = frames_at(read, ns + 10**9)
    for side, name in GRIP_BODY.items():
        wanted = velma.grip(np.array(state.body), side).homogeneous
        np.testing.assert_allclose(in_world(frames, name), wanted, atol=CLOSE)
    _, truth = telemetry.every(past, TrueState)[-1]
    assert truth.poses
    for name, pose in truth.poses.items():
        assert in_world(frames, name)[:3, 3] == pytest.approx(pose.xyz)


def test_things_that_only_were_seen_stand_where_they_were_seen(past):
    """On a robot whose true world nobody tells; with each state of the robot again."""
    robot = ros.Robot()
    happenings = of_history(with_truth(past, ()))
    found = [entry for one in happenings for entry in robot.take(one)]
    contents = (one.content for one in past.said)
    seen = {one.object: one.pose.xyz for one in contents if isinstance(one, wm.SeenObject)}
    assert seen
    last = [one.message for one in found if one.topic == "/tf"][-1].transforms
    places = {one.child_frame_id: one.transform.translation for one in last}
    for name, xyz in seen.items():
        assert (places[name].x, places[name].y, places[name].z) == pytest.approx(xyz)
    looks = [one.message for one in found if one.topic == "/objects"][-1].markers
    assert {one.ns for one in looks[1:]} == seen.keys()


def test_the_model_in_the_bag_is_one_that_rerun_loads(read, tmp_path):
    """Its links are the frames of the bag."""
    ((at, told),) = read["/robot_description"]
    (tmp_path / "velma.urdf").write_text(told.data)
    model = UrdfTree.from_file_path(tmp_path / "velma.urdf")
    assert {joint.child_link for joint in model.joints()} <= frames_at(read, at + 10**12).keys()


def test_things_have_looks_in_their_own_frames(read, past):
    """The last array has all of them, after a word that takes away what was there."""
    _, truth = telemetry.every(past, TrueState)[-1]
    gone, *parts = read["/objects"][-1][1].markers
    assert gone.action == 3  # DELETEALL
    assert {one.header.frame_id for one in parts} == truth.poses.keys()
    assert all(one.frame_locked and one.scale.x > 0 and one.color.a > 0 for one in parts)
    surfaces = [one for one in parts if one.type == 11]  # TRIANGLE_LIST
    assert {one.ns.partition("_")[0] for one in surfaces} == {"jar", "bowl"}
    radius = max(np.hypot(point.x, point.y) for one in surfaces for point in one.points)
    assert radius == pytest.approx(0.1, abs=1e-3)  # of the bowl's rim
    assert len(read["/grains"][-1][1].points) == len(truth.grains_at)


def test_pictures_have_their_bytes_and_the_lens(read):
    """The head camera's in its frame, the room's in the world."""
    for topic, jpeg, frame in (
        ("/camera/image/compressed", JPEG, "head_kinect_rgb_optical_frame"),
        ("/room/image/compressed", ROOM, "world"),
    ):
        ((_, told),) = read[topic]
        assert (bytes(told.data), told.format, told.header.frame_id) == (jpeg, "jpeg", frame)
    ((_, lens),) = read["/camera/camera_info"]
    across = 2 * np.arctan(lens.width / 2 / lens.k[0])
    assert across == pytest.approx(1.047, abs=1e-3)
    assert (lens.k[2], lens.k[5]) == (lens.width / 2, lens.height / 2)


def test_logs_and_what_is_against_the_design_are_in_rosout(read):
    """With their levels; lines that are none are left out."""
    lines = [(one.name, one.level, one.msg) for _, one in read["/rosout"]]
    assert lines[0] == ("km", 30, "slow ms=7")
    ((name, level, text),) = lines[1:]
    assert (name, level) == ("judge", 40)
    assert AGAINST in text


def test_agents_and_loop_are_diagnosed(read, past):
    """Who is gone is an error; each second everybody is told again."""
    told = [status for _, one in read["/diagnostics"] for status in one.status]
    assert {one.name for one in told} >= {"agents/pl", "agents/km", "loop"}
    last = [one for one in told if one.name == "agents/pl"][-1]
    assert (last.level, last.message) == (2, "gone; its last state was searching")
    spans = np.diff([at for at, one in read["/diagnostics"] if len(one.status) > 1])
    assert spans.max() <= 1.01e9


def test_later_readers_get_what_is_latched(written):
    """By the quality that the bag offers for it."""
    with Reader(written[0]) as reader:
        latched = {
            one.topic for one in reader.connections if one.ext.offered_qos_profiles == [bag.LATCHED]
        }
    assert latched == {"/robot_description", "/tf_static", "/objects", "/grains"}


def test_rerun_reads_it(written, tmp_path):
    """Without a complaint, and all that it can draw: frames, curves, pictures, logs, the model."""
    file = written[0] / "pour.mcap"
    checked = subprocess.run([RERUN, "mcap", "check", file], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    made = tmp_path / "pour.rrd"
    subprocess.run([RERUN, "mcap", "convert", file, "-o", made], check=True, capture_output=True)
    shown = subprocess.run(
        [RERUN, "rrd", "print", "-v", made], capture_output=True, text=True, check=True
    ).stdout
    for what in ("Transform3D:", "Scalars:", "EncodedImage:", "TextLog:", "Pinhole:"):
        assert what in shown, what


# --- Real ROS 2 -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ros_python(tmp_path_factory):
    """A Python with the real rclpy, in an environment of its own, in the versions that are
    locked.
    """
    if platform.machine() != "x86_64":
        pytest.skip("needs ROS 2's wheels, for x86-64 (PyPI: pip install ros-rclpy)")
    place = tmp_path_factory.mktemp("ros") / "env"
    python = place / "bin" / "python"
    lock = ROOT / "requirements" / "ros2.txt"
    for words in (
        ["venv", "--python", sys.executable, place],
        ["pip", "install", "--python", python, "--require-hashes", "-r", lock],
    ):
        subprocess.run([UV, "--quiet", *words], check=True, timeout=240)
    return python


def plain(value):
    """A message of ours, as in_ros.py tells one; constants of its type are none of its fields. A
    colour has single precision.
    """
    if type(value).__name__.endswith("ColorRGBA"):
        return {name: float(np.float32(getattr(value, name))) for name in "rgba"}
    if is_dataclass(value):
        names = [one.name for one in fields(value) if re.match("[a-z]", one.name)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(one) for one in value] if isinstance(value, list | tuple) else value


@pytest.mark.process
@pytest.mark.timeout(300)
def test_rclpy_reads_what_was_meant_and_has_the_same_types(ros_python, written, run, tmp_path):
    """One message of each topic; the hash of each type is the real one, that of our own type and of
    tf2_msgs, which the wheels lack, by ROS's own generator.
    """
    made = {"fipa_msgs": messages.DEFINITION.parents[1], "tf2_msgs": tmp_path / "tf2_msgs"}
    (made["tf2_msgs"] / "msg").mkdir(parents=True)
    text = "geometry_msgs/TransformStamped[] transforms\n"
    (made["tf2_msgs"] / "msg" / "TFMessage.msg").write_text(text)
    asked, meant = [], []
    for one in {one.topic: one for one in bag.entries(run)}.values():
        if one.kind.partition("/")[0] not in made:
            data = bytes(messages.TYPES.serialize_cdr(one.message, one.kind))
            asked.append((one.kind, base64.b64encode(data).decode()))
            meant.append(plain(one.message))
    answer = messages.triggered(True, "stopped")
    asked.append((messages.TRIGGER, base64.b64encode(answer).decode()))
    meant.append({"success": True, "message": "stopped"})
    packages = {name: str(place) for name, place in made.items()}
    (tmp_path / "request").write_text(json.dumps({"messages": asked, "packages": packages}))
    program = Path(__file__).with_name("in_ros.py")
    words = [ros_python, "-P", program, tmp_path / "request", tmp_path / "answer"]
    subprocess.run(words, check=True, timeout=100, cwd=tmp_path, env={"HOME": str(tmp_path)})
    answer = json.loads((tmp_path / "answer").read_text())
    assert answer["read"] == meant
    with Reader(written[0]) as reader:
        written_hashes = {one.msgtype: one.digest for one in reader.connections}
    assert len(written_hashes) == 10
    assert written_hashes == {kind: answer["hashes"][kind] for kind in written_hashes}
    assert written_hashes == {kind: messages.hashed(kind) for kind in written_hashes}
    assert answer["hashes"][messages.TRIGGER] == messages.TRIGGER_HASH


# --- `roco export --bag` --------------------------------------------------------------------------


def export(*words, code=0):
    done = CliRunner().invoke(app, ["export", *map(str, words)])
    assert done.exit_code == code, done.output
    return done


def test_the_verb_tells_topics_and_leaves_what_is_there(tmp_path):
    """A bag is private, and no folder is overwritten."""
    folder = tmp_path / "pour"
    told = json.loads(export(POUR, "--bag", folder, "--format", "json").stdout)
    assert told["bytes"] == sum(one.stat().st_size for one in folder.iterdir())
    assert {"/joint_states", "/tf", "/communicates/C4"} <= {one["topic"] for one in told["topics"]}
    assert folder.stat().st_mode & 0o777 == 0o700
    before = {one.name: one.stat().st_mtime_ns for one in folder.iterdir()}
    assert "is there already" in export(POUR, "--bag", folder, code=2).stderr
    assert {one.name: one.stat().st_mtime_ns for one in folder.iterdir()} == before
    export(POUR, "--bag", tmp_path / "a", "--out", tmp_path / "b", code=2)
    assert "--out FOLDER for tables, or --bag FOLDER" in export(POUR, code=2).stderr
    assert [one.name for one in tmp_path.iterdir()] == ["pour"]


def test_a_bag_that_cannot_be_finished_is_taken_away(run, tmp_path):
    """So that nobody takes half of a run for the whole."""

    def failing():
        yield from bag.entries(run)
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="full"):
        bag.write(tmp_path / "half", failing())
    assert list(tmp_path.iterdir()) == []


def test_without_rosbags_the_extra_is_named(tmp_path, monkeypatch):
    """Exit code 1, and how to get it; without the option nothing of it is asked for."""
    (tmp_path / "rosbags.py").write_text(
        "raise ModuleNotFoundError(\"No module named 'rosbags'\", name='rosbags')\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(tmp_path), os.environ["PYTHONPATH"])))
    words = [sys.executable, "-m", "console", "export", POUR]
    done = subprocess.run([*words, "--bag", tmp_path / "bag"], capture_output=True, text=True)
    assert done.returncode == 1
    assert "rosbags is not installed here: pip install 'robot-companion[ros]'" in done.stderr
    subprocess.run([*words, "--out", tmp_path / "tables"], check=True, capture_output=True)
