"""docs/http.md over a real socket, with an agent that answers at once, late, or never."""

import os
import re
import socket
import subprocess
import sys
import threading
import time

import msgspec
import pytest
from typer.testing import CliRunner

from agent_runtime.io.run_files import STOP_FILE, STOP_HELD, STOP_RELEASED, listen_at
from companion.run_files import HI_FILE, SLOTS_FILE, Events, HiAddress, HiEvent, Question, TaskLine, Tasks
from companion.tools.verbs.hi import terminal
from operate.cli.__main__ import app
from services.human_interface import server
from services.human_interface.grammar import understand
from services.human_interface.local import CancelWanted, Halted, Said, Shown, StopRobot, Told

LINE = TaskLine("hi-1-3", "waiting", "I will look around.", "look around", 1.0)


def test_the_address_is_for_its_owner_alone(client):
    """Mode 0600; gone when the desk closes."""
    assert (client.run_dir / HI_FILE).stat().st_mode & 0o777 == 0o600
    assert len(client.address.token) >= 32
    assert os.listdir(client.run_dir) == [HI_FILE]


def test_say_and_cancel_reach_the_agent_and_bring_its_answer(client):
    """POST /say, POST /cancel."""
    status, data = client.ask("POST", "/say", b'{"text": "look around"}')
    assert (status, msgspec.json.decode(data, type=TaskLine)) == (200, LINE)
    status, data = client.ask("POST", "/cancel", b"{}")
    assert (status, msgspec.json.decode(data, type=TaskLine)) == (200, LINE)
    assert [type(word) for word in client.words] == [Said, CancelWanted]


@pytest.mark.parametrize(
    ("words", "urgency", "within_s"),
    [
        ("look around first, within ten minutes", 1, 600.0),
        ("look around by 15:30", 0, 1770.0),
        ("look around by half past three", 0, 1770.0),
        ("look around", 0, 0.0),
    ],
)
def test_when_a_sentence_is_wanted_goes_to_the_agent_as_seconds(client, monkeypatch, words, urgency, within_s):
    """A time of day by the clock of who says it: it is 15:00:30 in a place that is 20 minutes ahead of UTC."""
    monkeypatch.setattr(server.time, "time", lambda: 1e9 // 86400 * 86400 + 14 * 3600 + 40 * 60 + 30.0)
    client.ask("POST", "/say", msgspec.json.encode({"text": words, "east_min": 20}))
    said = client.words[-1]
    assert (said.urgency, round(said.within_s, 6), said.east_min) == (urgency, within_s, 20)


def test_noon_is_another_time_elsewhere(client):
    """By the clock of the asker, else by hi's own."""
    left = []
    own = time.localtime().tm_gmtoff // 60
    for more in ({"east_min": own}, {}, {"east_min": own + 61}):
        client.ask("POST", "/say", msgspec.json.encode({"text": "look around at noon"} | more))
        left.append(client.words[-1].later_s)
    assert client.words[-2].east_min == own
    assert (left[0] - left[1]) % 86400.0 < 60.0
    assert 3660.0 - 60.0 < (left[1] - left[2]) % 86400.0 <= 3660.0 + 60.0
    assert client.refused("POST", "/say", b'{"text": "look around", "east_min": 1441}')[0] == 400


def test_what_the_agent_refuses_keeps_its_status(client):
    """503 and 404 with its words."""
    assert client.refused("POST", "/say", b'{"text": "status"}') == (503, "no coordinator yet")
    assert client.refused("POST", "/cancel", b'{"task": "hi-9-9"}')[0] == 404


def test_tasks_are_what_the_agent_showed_last(client):
    """GET /tasks."""
    client.desk.tell(Shown((LINE,), 0))
    status, data = client.ask("GET", "/tasks")
    assert (status, msgspec.json.decode(data, type=Tasks).tasks) == (200, (LINE,))


def test_events_come_after_a_number_and_can_be_waited_for(client):
    """GET /events: at once what is there; else as soon as there is something."""
    client.desk.tell(Told(HiEvent(1, 1.0, "co", "waiting", "next")))
    status, data = client.ask("GET", "/events")
    events = msgspec.json.decode(data, type=Events)
    assert (status, events.next, [event.n for event in events.events]) == (200, 1, [1])
    timer = threading.Timer(0.1, client.desk.tell, (Told(HiEvent(2, 2.0, "co", "done", "")),))
    timer.start()
    begun = time.monotonic()
    _, data = client.ask("GET", f"/events?since={events.next}&wait=10")
    assert [event.n for event in msgspec.json.decode(data, type=Events).events] == [2]
    assert time.monotonic() - begun < 5.0
    timer.join()


def test_after_a_restart_the_number_goes_on(client):
    """Older events are left out, and `next` is right to ask with."""
    client.desk.tell(Shown((), 41))
    _, data = client.ask("GET", "/events?since=7")
    assert msgspec.json.decode(data, type=Events) == Events(41, ())


def test_without_the_token_or_with_another_host_nobody_is_served(client):
    """401 and 403, in words, and the agent hears nothing."""
    say = ("POST", "/say", b'{"text": "look around"}')
    assert client.refused(*say, Authorization=None)[0] == 401
    assert client.refused(*say, Authorization="Bearer wrong")[0] == 401
    assert client.refused(*say, Authorization="Bearer ä")[0] == 401
    assert client.refused(*say, Host="evil.example")[0] == 403
    assert client.ask(*say, Host=f"localhost:{client.address.port}")[0] == 200
    assert len(client.words) == 1


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b"{}", b'{"text": 3}', b'{"text": "a", "more": 1}', b'{"text": "\xff"}', b'{"text": "\\ud800"}'],
)
def test_a_body_that_is_not_what_is_wanted_is_refused_in_words(client, body):
    """400, and the agent hears nothing."""
    status, words = client.refused("POST", "/say", body)
    assert (status, client.words) == (400, [])
    assert "text" in words


def test_deep_nesting_is_refused(client):
    """No RecursionError gets out."""
    assert client.refused("POST", "/say", b'{"text": ' + b"[" * 4000)[0] == 400


@pytest.mark.parametrize("size", [4097, 60_000])
def test_a_body_too_long_is_refused(client, size):
    """413, and the sender can read it."""
    assert client.refused("POST", "/say", b" " * size)[0] == 413


def test_unknown_paths_and_wrong_verbs_are_refused(client):
    """404 and 405, naming what there is."""
    status, words = client.refused("GET", "/dance")
    assert status == 404
    assert "/say" in words
    assert client.refused("GET", "/say")[0] == 405
    assert client.refused("POST", "/tasks", b"{}")[0] == 405
    assert client.refused("BREW", "/tasks")[0] == 501


@pytest.mark.parametrize("query", ["since=x", "wait=x", "since=-1", "wait=11", "wait=nan", "what=1"])
def test_a_query_that_is_no_number_is_refused(client, query):
    """400."""
    assert client.refused("GET", f"/events?{query}")[0] == 400


def test_an_agent_that_says_nothing_ends_in_503(client, monkeypatch):
    """Every wait ends."""
    monkeypatch.setattr(server, "ANSWER_S", 0.1)
    status, words = client.refused("POST", "/say", b'{"text": "silence"}')
    assert status == 503
    assert "/tasks" in words


def test_closing_ends_the_waits(client):
    """A request for events is answered when the desk closes."""
    answers = []
    waiter = threading.Thread(target=lambda: answers.append(client.ask("GET", "/events?wait=10")[0]))
    waiter.start()
    while client.desk._server.room._value == server.AT_ONCE:
        time.sleep(0.001)
    client.desk.close()
    waiter.join(5.0)
    assert answers == [200]
    assert not (client.run_dir / HI_FILE).exists()


def test_it_listens_where_it_is_told(tmp_path):
    """A container is reached at a fixed port; people ask under the same port, so the check of Host holds."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    desk = server.HttpDevice(lambda content: None, tmp_path, listen_at(f"127.0.0.1:{port}"))
    try:
        told = msgspec.json.decode((tmp_path / HI_FILE).read_bytes(), type=HiAddress)
        assert told.port == port
        with socket.create_connection(("127.0.0.1", port), timeout=5.0):
            pass
    finally:
        desk.close()


def test_an_address_that_is_taken_is_named_with_its_variable(tmp_path):
    """`roco up` shows these words where hi is given up."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        words = f"127.0.0.1:{port} cannot be listened at: Address already in use; ROCO_HTTP names another address"
        with pytest.raises(OSError, match=re.escape(words)):
            server.HttpDevice(lambda content: None, tmp_path, ("127.0.0.1", port))


def test_without_a_word_it_listens_on_loopback_only():
    """Another address must be asked for."""
    assert listen_at("") == ("127.0.0.1", 0)


@pytest.mark.parametrize("text", ["8350", ":8350", "0.0.0.0:", "0.0.0.0:http", "0.0.0.0:65536", "0.0.0.0:-1"])
def test_what_is_no_address_is_named(text):
    """With what would have been right."""
    with pytest.raises(ValueError, match=r"is not an address to listen at, expected host:port"):
        listen_at(text)


# --- stop and release -------------------------------------------------------------------------------------------------

STOPS = [
    ("/stop", b""),
    ("/stop", b"{}"),
    ("/stop", b"not JSON"),
    ("/say", b'{"text": "STOP!!!"}'),
    ("/say", b'{"text": "careful"}'),
]


@pytest.fixture
def robot(client):
    """A client whose desk shares its run folder with a control loop."""
    (client.run_dir / SLOTS_FILE).touch()
    (client.run_dir / STOP_FILE).write_bytes(STOP_RELEASED)
    return client


def flag(client):
    """The byte that the loop reads."""
    return (client.run_dir / STOP_FILE).read_bytes()


@pytest.mark.parametrize(("path", "body"), STOPS)
def test_a_stop_needs_no_agent_and_no_room(robot, monkeypatch, path, body):
    """The agent answers nobody, and as many wait as may: the byte is set before the answer."""
    monkeypatch.setattr(robot.desk._server, "post", lambda content: None)
    monkeypatch.setattr(robot.desk._server, "room", threading.Semaphore(0))
    assert robot.refused("GET", "/events?wait=1")[0] == 503
    status, data = robot.ask("POST", path, body)
    line = msgspec.json.decode(data, type=TaskLine)
    assert (status, line.state, flag(robot)) == (200, "stopped", STOP_HELD)
    assert "roco release" in line.text
    status, data = robot.ask("POST", "/release", b"{}")
    assert (status, msgspec.json.decode(data, type=TaskLine).state, flag(robot)) == (200, "released", STOP_RELEASED)


@pytest.mark.parametrize(("words", "told"), [("help, I've fallen", "put down the X"), ("pomocy!", "odłóż X")])
def test_a_call_for_help_stops_and_is_told_what_can_be_said(robot, words, told):
    """By hi, and by `roco say`, which sets the flag itself; in the language of the call."""
    status, data = robot.ask("POST", "/say", msgspec.json.encode({"text": words}))
    line = msgspec.json.decode(data, type=TaskLine)
    assert (status, line.state, told in line.text, flag(robot)) == (200, "stopped", True, STOP_HELD)
    robot.ask("POST", "/release")
    done = CliRunner().invoke(app, ["say", words, "--run-dir", str(robot.run_dir)])
    assert (done.exit_code, told in done.stdout, flag(robot)) == (0, True, STOP_HELD), done.output


def asked(robot, asker, for_s=30.0):
    """hi has asked somebody something."""
    question = Question(asker, time.time() + for_s, ("yes", "no", "tak", "nie"))
    robot.desk.tell(Shown((), 0, questions=(question,)))


@pytest.mark.parametrize("answer", ["no", "nie", "Nie!", "tak"])
def test_an_answer_of_who_was_asked_goes_to_the_agent_and_stops_nothing(robot, answer):
    """With the asker, and when it was said."""
    asked(robot, "kitchen")
    robot.ask("POST", "/say", msgspec.json.encode({"text": answer, "asker": "kitchen"}))
    assert flag(robot) == STOP_RELEASED
    said = robot.words[-1]
    assert (said.text, said.asker, abs(said.at - time.time()) < 60.0) == (answer, "kitchen", True)


@pytest.mark.parametrize(
    ("text", "asker", "for_s"),
    [("nie", "hall", 30.0), ("no", "", 30.0), ("nie", "kitchen", -1.0), ("stop", "kitchen", 30.0)]
    + [(text, "kitchen", 30.0) for text in ("no no", "nie, nie", "nie bierz", "no, stop", "stój", "help")],
)
def test_whatever_is_no_answer_of_who_was_asked_stops(robot, text, asker, for_s):
    """Another one's no, a no that comes too late, and every other stop word while the question is open."""
    asked(robot, "kitchen", for_s)
    status, data = robot.ask("POST", "/say", msgspec.json.encode({"text": text, "asker": asker}))
    assert (status, msgspec.json.decode(data, type=TaskLine).state, flag(robot)) == (200, "stopped", STOP_HELD)


def test_a_terminal_that_was_asked_answers_and_another_one_stops(robot):
    """`roco say no`: the terminal is told by its session, which a further call in it shares."""
    command = [sys.executable, "-m", "operate.cli", "say", "nie", "--run-dir", str(robot.run_dir)]
    asked(robot, terminal())
    subprocess.run(command, capture_output=True, timeout=50, check=False)
    assert (robot.words[-1].text, robot.words[-1].asker, flag(robot)) == ("nie", terminal(), STOP_RELEASED)
    subprocess.run(command, capture_output=True, timeout=50, check=True, start_new_session=True)
    assert flag(robot) == STOP_HELD


@pytest.mark.parametrize(("zone", "east_min"), [("<+0545>-5:45", 345), ("EST5", -300), ("UTC", 0)])
def test_a_terminal_tells_its_time_zone(robot, zone, east_min):
    """`roco say`: noon is noon where it is called."""
    command = [sys.executable, "-m", "operate.cli", "say", "look around at noon", "--run-dir", str(robot.run_dir)]
    subprocess.run(command, env=os.environ | {"TZ": zone}, capture_output=True, timeout=50, check=False)
    said = next(word for word in robot.words if isinstance(word, Said))
    assert said.east_min == east_min
    assert (said.at + said.later_s + 60 * east_min) % 86400.0 == pytest.approx(43200.0, abs=0.01)


def test_a_no_in_a_terminal_stops_where_hi_does_not_answer(robot, monkeypatch):
    """It is waited for a second; what it says five seconds later counts for nothing."""
    over, question = threading.Event(), Question(terminal(), time.time() + 30.0, ("no", "nie"))
    late = Tasks((), questions=(question,))
    monkeypatch.setattr(robot.desk._server.board, "tasks", lambda: (over.wait(5.0), late)[1])
    done = CliRunner().invoke(app, ["say", "nie", "--run-dir", str(robot.run_dir)])
    assert (done.exit_code, flag(robot), over.is_set()) == (0, STOP_HELD, False), done.output
    over.set()


def test_the_agent_hears_of_a_stop_and_of_its_end(robot):
    """So that it is told to others."""
    robot.ask("POST", "/stop")
    robot.ask("POST", "/release")
    assert [(word.held, word.reached) for word in robot.words] == [(True, True), (False, True)]


def test_what_is_said_to_a_stopped_robot_comes_with_that(robot):
    """The agent reads no files."""
    robot.ask("POST", "/say", b'{"text": "look around"}')
    robot.ask("POST", "/stop")
    robot.ask("POST", "/say", b'{"text": "look around"}')
    assert [word.held for word in robot.words if isinstance(word, Said)] == [False, True]


@pytest.mark.parametrize(("path", "body"), [*STOPS, ("/release", b"")])
def test_a_robot_out_of_reach_is_not_called_stopped(client, path, body):
    """Its loop has another run folder, as in containers: 503, what was done instead, and what would stop it."""
    status, words = client.refused("POST", path, body)
    assert status == 503
    assert "roco release" in words if path == "/release" else "roco stop" in words
    assert client.words == [Halted(path != "/release", False, words)]
    assert not (client.run_dir / STOP_FILE).exists()


@pytest.mark.parametrize("path", ["/stop", "/release"])
def test_a_stop_asks_who_stops(robot, path):
    """With the token only, as everything; and never by GET, which pages can send."""
    assert robot.refused("POST", path, b"{}", Authorization=None)[0] == 401
    assert robot.refused("GET", path)[0] == 405
    assert flag(robot) == STOP_RELEASED


def test_a_flag_that_cannot_be_written_is_told(robot):
    """Nobody is to believe in a stop that was not."""
    (robot.run_dir / STOP_FILE).unlink()
    (robot.run_dir / STOP_FILE).mkdir()
    status, words = robot.refused("POST", "/stop")
    assert (status, "cannot be written" in words) == (503, True)


def test_the_agent_can_stop_the_robot_too(robot):
    """A word that turns out to mean it sets the flag first, then is answered."""
    ticket = robot.desk._board.ticket()
    robot.desk.tell(StopRobot(ticket, "no"))
    answer = robot.desk._board.answer(ticket, 5.0)
    assert (answer.line.state, flag(robot)) == ("stopped", STOP_HELD)


def test_a_sentence_reaches_the_agent_with_its_meaning(client):
    """It is read in the thread of the request, not in the agent's step."""
    client.ask("POST", "/say", b'{"text": "take the jar"}')
    assert client.words[-1].meaning == understand("take the jar")
    assert client.words[-1].meaning.clauses
