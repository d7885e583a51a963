"""What a browser is shown of tasks and of the robot's telemetry, and that the words of both
languages match.
"""

import base64
import re
import socket
import time
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from companion.languages.cmd import TaskState
from companion.languages.evidence import Claim, Evidence, Sense
from companion.languages.hfsm import Place, Step
from companion.run_files import InWords, TaskLine
from companion.telemetry import Camera, Frame, Picture, RobotState, Watch
from services.page.__main__ import _listening
from services.page.app import Streams
from services.page.robot import RobotEye
from services.page.view import LANGUAGES, PICTURES, WORDS, Heard, view

pytestmark = pytest.mark.timeout(30)
ROOT = Path(__file__).parents[2]
STEP = Step("hand-over", ("jar_1",))
LINE = TaskLine(
    "hi-1-1", TaskState.RUNNING, "", at=Place(("hand over jar_1", "give"), STEP, "HandOver"),
    steps=(STEP,), number=1,
    wish=InWords("hand over the jar", "podaj słoik"),
)  # fmt: skip
ASKED = {
    "en": "Please take the jar: pull gently, and I let go.",
    "pl": "Proszę wziąć słoik: wystarczy lekko pociągnąć, a puszczę.",
}
PUT, HELD = Evidence(Claim.STANDS, "jar_1"), Evidence(Claim.HELD, "bowl_1", (Sense.WRIST,), 3.0)
STATE = RobotState(sim_time_s=1.5, body=(0.1,) * 15, mode="hold")


def test_both_languages_say_the_same():
    """Each row of a language has its row in the other, with as many blanks."""
    english, polish = (
        {name: text.count("{") for name, text in WORDS[language].items()} for language in LANGUAGES
    )
    assert english == polish


def test_a_person_is_asked_while_the_robot_waits_for_a_pull():
    """In the person's language, with the thing in it; at no other time."""
    others = {
        "on the way": ({"at": replace(LINE.at, act="MoveJoint")}, {}),
        "before": ({"at": None}, {}),
        "the operator first": ({"asks": "hand over jar_1/give"}, {}),
        "over": ({"state": TaskState.DONE}, {}),
        "stopped": ({}, {"held": True}),
        "away": ({}, {"hi": False}),
    }
    for language, asked in ASKED.items():
        assert view(Heard(hi=True, tasks=(LINE,)), language).please == asked
        for when, (changes, stands) in others.items():
            heard = Heard(**{"hi": True, "tasks": (replace(LINE, **changes),), **stands})
            assert view(heard, language).please == "", when


def test_the_steps_of_all_plans_are_counted_together():
    """A plan that follows another one goes on with its count."""
    later = replace(LINE, before=3, number=1, steps=(STEP, STEP))
    assert view(Heard(hi=True, tasks=(later,)), "en").step.startswith("Step 4 of 5: ")


def unchecked(state, evidence, language):
    """What the page says beside an ended task."""
    put = "put the jar on the table"
    line = TaskLine("hi-1-1", state, "", put, accepted=True, evidence=evidence)
    (task,) = view(Heard(hi=True, tasks=(line,)), language).ended
    return task.unchecked


def test_only_what_was_done_and_not_checked_is_said():
    """In the language of the page. A task that failed says why; a claim with a sense behind it
    needs no words.
    """
    for language, thing in zip(LANGUAGES, ("jar", "słoik"), strict=True):
        assert thing in unchecked(TaskState.DONE, (PUT, HELD), language)
        assert unchecked(TaskState.DONE, (HELD,), language) == ""
        assert unchecked(TaskState.FAILED, (PUT,), language) == ""


def test_both_pictures_are_given_as_they_are():
    """By name, and when they were true; an image of the page's own origin needs no request of the
    browser. What is no telemetry, and no frame, is left out.
    """
    pictures = []
    modes = []
    eye = RobotEye(None, lambda *picture: pictures.append(picture), modes.append)  # type: ignore[arg-type]
    for told in (STATE, Picture(2.0, b"for recorders", b"for recorders"), STATE):
        eye._heard(msgspec.msgpack.encode(told))
    begin = time.time()
    for camera, file in zip(Camera, (b"by the head", b"from the room"), strict=True):
        eye._seen(msgspec.msgpack.encode(Frame(camera, 7, 0.5, file)))
    assert [name for name, _, _ in pictures] == list(PICTURES)
    urls = [url for _, url, _ in pictures]
    files = [base64.b64decode(url.removeprefix("data:image/jpeg;base64,")) for url in urls]
    assert files == [b"by the head", b"from the room"]
    assert all(begin <= at + 0.5 <= time.time() for _, _, at in pictures)
    assert modes == ["hold"]
    for data in (b"", b"\xc1", msgspec.msgpack.encode({"type": "Picture", "rgb": b""})):
        eye._heard(data)
        eye._seen(data)
    assert (len(pictures), len(modes)) == (2, 1)


def test_a_picture_is_still_true_only_where_it_came():
    """A word about another one, which was lost, makes no old picture new; ex hears which ones the
    page has.
    """
    pictures = []
    eye = RobotEye(None, lambda *picture: pictures.append(picture), print)  # type: ignore[arg-type]
    for number, file in ((7, b"a picture"), (7, b""), (8, b"")):
        eye._seen(msgspec.msgpack.encode(Frame(Camera.ROOM, number, 0.0, file)))
    assert [(name, bool(url)) for name, url, _ in pictures] == [("room", True), ("room", False)]
    assert eye._wish(frozenset({"room"})) == Watch((Camera.ROOM,), {Camera.ROOM: 7})


def test_a_slow_browser_gets_the_newest_picture_of_each_kind():
    """Older ones take no memory."""
    streams = Streams()
    for number in range(100):
        for name in PICTURES:
            streams.tell(name, name, b"%d" % number)
    newest = [b"event: %s\ndata: 99\n\n" % name.encode() for name in PICTURES]
    assert [streams._newest[name][1] for name in PICTURES] == newest


def test_a_port_that_is_taken_is_named_with_its_variable():
    """`roco status` shows these words of a page that was given up."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        words = re.escape(
            f"127.0.0.1:{port} cannot be listened at: Address already in use; ROCO_PAGE names"
            " another"
        )
        with pytest.raises(OSError, match=words):
            _listening("127.0.0.1", port, None)


def test_a_browser_hears_every_event_that_the_page_tells() -> None:
    """By its name, which stands in the code of both sides."""
    app = (ROOT / "services/page/app.py").read_text("utf-8")
    told = {*re.findall(r'\b(?:sse|tell)\(\s*(?:[\w()]+, )?"(\w+)", ', app), *PICTURES}
    script = (ROOT / "services/page/static/page.js").read_text("utf-8")
    heard = set(re.findall(r'\bsource\.addEventListener\("(\w+)"', script))
    beats = re.search(r"of \[(.*?)\]\) source\.addEventListener", script)
    assert beats is not None
    heard |= set(re.findall(r'"(\w+)"', beats[1]))
    assert len(told) == 7
    assert heard == told
