"""docs/http.md over a real socket, with an agent that answers at once, late, or never."""

import asyncio
import contextlib
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
from companion import loopback_server
from companion.loopback_server import MOST
from companion.run_files import (
    HI_FILE,
    SLOTS_FILE,
    Events,
    HiAddress,
    HiEvent,
    Problem,
    Question,
    TaskLine,
    Tasks,
)
from companion.tools.verbs.hi import terminal
from operate.cli.__main__ import app
from services.human_interface import server
from services.human_interface.device_messages import CancelWanted, Halted, NewEvent, Sentence, Shown
from services.human_interface.grammar import understand

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
    assert [type(word) for word in client.words] == [Sentence, CancelWanted]


def test_when_a_sentence_is_wanted_goes_to_the_agent_as_seconds(client, monkeypatch):
    """A time of day by the clock of who says it: it is 15:00:30 in a place that is 20 minutes ahead
    of UTC.
    """
    monkeypatch.setattr(
        server.time, "time", lambda: 1e9 // 86400 * 86400 + 14 * 3600 + 40 * 60 + 30.0
    )
    wanted = {
        "look around first, within ten minutes": (1, 600.0),
        "look around by 15:30": (0, 1770.0),
        "look around by half past three": (0, 1770.0),
        "look around": (0, 0.0),
    }
    for words in wanted:
        client.ask("POST", "/say", msgspec.json.encode({"text": words, "east_min": 20}))
    assert {said.text: (said.urgency, round(said.within_s, 6)) for said in client.words} == wanted
    assert {said.east_min for said in client.words} == {20}


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
    client.app.tell(Shown((LINE,), 0))
    status, data = client.ask("GET", "/tasks")
    assert (status, msgspec.json.decode(data, type=Tasks).tasks) == (200, (LINE,))


def test_events_come_after_a_number_and_can_be_waited_for(client):
    """GET /events: at once what is there; else as soon as there is something."""
    client.tell_event(1)
    status, data = client.ask("GET", "/events")
    events = msgspec.json.decode(data, type=Events)
    assert (status, events.next, [event.n for event in events.events]) == (200, 1, [1])
    timer = threading.Timer(0.1, client.tell_event, (2,))
    timer.start()
    begun = time.monotonic()
    _, data = client.ask("GET", f"/events?since={events.next}&wait=10")
    assert [event.n for event in msgspec.json.decode(data, type=Events).events] == [2]
    assert time.monotonic() - begun < 5.0
    timer.join()


def test_who_hears_of_an_event_finds_the_tasks_as_it_left_them(client):
    """Not those of before it: a page that asks for the tasks between the two would show these until
    the next event.
    """
    client.app.tell(NewEvent(HiEvent(1, 1.0, "co", "waiting", "next")))
    _, data = client.ask("GET", "/events?wait=0.2")
    assert msgspec.json.decode(data, type=Events) == Events(0, ())
    client.app.tell(Shown((LINE,), 1))
    _, data = client.ask("GET", "/events?wait=10")
    assert [event.n for event in msgspec.json.decode(data, type=Events).events] == [1]
    _, data = client.ask("GET", "/tasks")
    assert msgspec.json.decode(data, type=Tasks).tasks == (LINE,)


def test_after_a_restart_the_number_goes_on(client):
    """Older events are left out, and `next` is right to ask with."""
    client.app.tell(Shown((), 41))
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


def test_a_body_that_is_not_what_is_wanted_is_refused_in_words(client):
    """400, and the agent hears nothing; also of what nests deep. 413 for what is too long: its
    sender can read it.
    """
    wrong = [
        b"",
        b"{",
        b"[]",
        b"{}",
        b'{"text": 3}',
        b'{"text": "a", "more": 1}',
        b'{"text": "\xff"}',
    ]
    for body in (*wrong, b'{"text": "\\ud800"}', b'{"text": ' + b"[" * 4000):
        status, words = client.refused("POST", "/say", body)
        assert (status, "text" in words) == (400, True), body[:50]
    assert [client.refused("POST", "/say", b" " * size)[0] for size in (4097, 60_000)] == [413, 413]
    assert client.words == []


def test_unknown_paths_and_wrong_verbs_are_refused(client):
    """404 and 405, naming what there is."""
    status, words = client.refused("GET", "/dance")
    assert status == 404
    assert "/say" in words
    assert client.refused("GET", "/say")[0] == 405
    assert client.refused("POST", "/tasks", b"{}")[0] == 405
    assert client.refused("BREW", "/tasks")[0] == 405


def test_a_query_that_is_no_number_is_refused(client):
    """400."""
    for query in ("since=x", "wait=x", "since=-1", "wait=11", "wait=nan", "what=1"):
        assert client.refused("GET", f"/events?{query}")[0] == 400, query


def test_an_agent_that_says_nothing_ends_in_503(client, monkeypatch):
    """Every wait ends."""
    monkeypatch.setattr(server, "ANSWER_S", 0.1)
    status, words = client.refused("POST", "/say", b'{"text": "silence"}')
    assert status == 503
    assert "/tasks" in words


def test_closing_ends_the_waits(client):
    """A request for events is answered when the desk closes."""
    answers = []
    waiter = threading.Thread(
        target=lambda: answers.append(client.ask("GET", "/events?wait=10")[0])
    )
    waiter.start()
    while not client.app.app.waiting:
        time.sleep(0.001)
    client.app.close()
    waiter.join(5.0)
    assert answers == [200]
    assert not (client.run_dir / HI_FILE).exists()


def test_it_listens_where_it_is_told(tmp_path):
    """A container is reached at a fixed port; people ask under the same port, so the check of Host
    holds.
    """
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
        words = (
            f"127.0.0.1:{port} cannot be listened at: Address already in use; ROCO_HTTP names"
            " another address"
        )
        with pytest.raises(OSError, match=re.escape(words)):
            server.HttpDevice(lambda content: None, tmp_path, ("127.0.0.1", port))


def test_without_a_word_it_listens_on_loopback_only():
    """Another address must be asked for; what is none is named, with what would have been right."""
    assert listen_at("") == ("127.0.0.1", 0)
    for text in ("8350", ":8350", "0.0.0.0:", "0.0.0.0:http", "0.0.0.0:65536", "0.0.0.0:-1"):
        with pytest.raises(ValueError, match=r"is not an address to listen at, expected host:port"):
            listen_at(text)


# --- stop and release -----------------------------------------------------------------------------

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


def test_a_stop_needs_no_agent_and_no_room(robot, monkeypatch):
    """The agent answers nobody, and as many wait as may: the byte is set before the answer."""
    monkeypatch.setattr(robot.app.app, "_post", lambda content: None)
    monkeypatch.setattr(robot.app.app, "waiting", server.AT_ONCE)
    assert robot.refused("GET", "/events?wait=1")[0] == 503
    for path, body in STOPS:
        status, data = robot.ask("POST", path, body)
        line = msgspec.json.decode(data, type=TaskLine)
        assert (status, line.state, flag(robot)) == (200, "stopped", STOP_HELD), body
        assert "roco release" in line.text
        status, data = robot.ask("POST", "/release", b"{}")
        state = msgspec.json.decode(data, type=TaskLine).state
        assert (status, state, flag(robot)) == (200, "released", STOP_RELEASED), body


def test_a_call_for_help_stops_and_is_told_what_can_be_said(robot):
    """By hi, and by `roco say`, which sets the flag itself; in the language of the call."""
    for words, told in (("help, I've fallen", "put down the X"), ("pomocy!", "odłóż X")):
        status, data = robot.ask("POST", "/say", msgspec.json.encode({"text": words}))
        line = msgspec.json.decode(data, type=TaskLine)
        assert (status, line.state, told in line.text, flag(robot)) == (
            200,
            "stopped",
            True,
            STOP_HELD,
        )
        robot.ask("POST", "/release")
        done = CliRunner().invoke(app, ["say", words, "--run-dir", str(robot.run_dir)])
        assert (done.exit_code, told in done.stdout, flag(robot)) == (
            0,
            True,
            STOP_HELD,
        ), done.output
        robot.ask("POST", "/release")


def asked(robot, asker, for_s=30.0):
    """hi has asked somebody something."""
    question = Question(asker, time.time() + for_s, ("yes", "no", "tak", "nie"))
    robot.app.tell(Shown((), 0, questions=(question,)))


def test_an_answer_of_who_was_asked_goes_to_the_agent_and_stops_nothing(robot):
    """With the asker, and when it was said."""
    asked(robot, "kitchen")
    for answer in ("no", "nie", "Nie!", "tak"):
        robot.ask("POST", "/say", msgspec.json.encode({"text": answer, "asker": "kitchen"}))
        said = robot.words[-1]
        assert (said.text, said.asker, abs(said.at - time.time()) < 60.0) == (
            answer,
            "kitchen",
            True,
        )
        assert flag(robot) == STOP_RELEASED, answer


def test_whatever_is_no_answer_of_who_was_asked_stops(robot):
    """Another one's no, a no that comes too late, and every other stop word while the question is
    open.
    """
    others = [
        ("nie", "hall", 30.0),
        ("no", "", 30.0),
        ("nie", "kitchen", -1.0),
        ("stop", "kitchen", 30.0),
    ]
    others += [
        (text, "kitchen", 30.0)
        for text in ("no no", "nie, nie", "nie bierz", "no, stop", "stój", "help")
    ]
    for text, asker, for_s in others:
        asked(robot, "kitchen", for_s)
        robot.ask("POST", "/release")
        status, data = robot.ask(
            "POST", "/say", msgspec.json.encode({"text": text, "asker": asker})
        )
        state = msgspec.json.decode(data, type=TaskLine).state
        assert (status, state, flag(robot)) == (200, "stopped", STOP_HELD), (text, asker)


def test_a_terminal_that_was_asked_answers_and_another_one_stops(robot):
    """`roco say no`: the terminal is told by its session, which a further call in it shares."""
    command = [sys.executable, "-m", "operate.cli", "say", "nie", "--run-dir", str(robot.run_dir)]
    asked(robot, terminal())
    subprocess.run(command, capture_output=True, timeout=50, check=False)
    assert (robot.words[-1].text, robot.words[-1].asker, flag(robot)) == (
        "nie",
        terminal(),
        STOP_RELEASED,
    )
    subprocess.run(command, capture_output=True, timeout=50, check=True, start_new_session=True)
    assert flag(robot) == STOP_HELD


def test_a_terminal_tells_its_time_zone(robot, monkeypatch):
    """`roco say`: noon is noon where it is called."""
    robot.app.tell(Shown((msgspec.structs.replace(LINE, accepted=True),), 0))
    for zone, east_min in (("<+0545>-5:45", 345), ("EST5", -300), ("UTC", 0)):
        monkeypatch.setenv("TZ", zone)
        time.tzset()
        done = CliRunner().invoke(
            app, ["say", "look around at noon", "--run-dir", str(robot.run_dir)]
        )
        said = robot.words[-1]
        assert (done.exit_code, said.east_min) == (0, east_min), done.output
        assert (said.at + said.later_s + 60 * east_min) % 86400.0 == pytest.approx(
            43200.0, abs=0.01
        )
    monkeypatch.undo()
    time.tzset()


def test_a_no_in_a_terminal_stops_where_hi_does_not_answer(robot, monkeypatch):
    """It is waited for a second; what it says five seconds later counts for nothing."""
    late = []

    async def tasks(request):
        await asyncio.sleep(5.0)
        late.append(Tasks((), questions=(Question(terminal(), time.time() + 30.0, ("no", "nie")),)))
        return late[0]

    monkeypatch.setitem(robot.app.app._routes, "/tasks", ("GET", tasks))
    done = CliRunner().invoke(app, ["say", "nie", "--run-dir", str(robot.run_dir)])
    assert (done.exit_code, flag(robot), late) == (0, STOP_HELD, []), done.output


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
    assert [word.held for word in robot.words if isinstance(word, Sentence)] == [False, True]


def test_a_robot_out_of_reach_is_not_called_stopped(client):
    """Its loop has another run folder, as in containers: 503, what was done instead, and what would
    stop it.
    """
    for path, body in (*STOPS, ("/release", b"")):
        status, words = client.refused("POST", path, body)
        assert status == 503
        assert "roco release" in words if path == "/release" else "roco stop" in words
        assert client.words[-1] == Halted(path != "/release", False, words)
    assert not (client.run_dir / STOP_FILE).exists()


def test_a_stop_asks_who_stops(robot):
    """With the token only, as everything; and never by GET, which pages can send."""
    for path in ("/stop", "/release"):
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
    _, data = robot.ask("POST", "/say", b'{"text": "that one"}')
    assert (msgspec.json.decode(data, type=TaskLine).state, flag(robot)) == ("stopped", STOP_HELD)


def test_a_sentence_reaches_the_agent_with_its_meaning(client):
    """It is read in the thread of the request, not in the agent's step."""
    client.ask("POST", "/say", b'{"text": "take the jar"}')
    assert client.words[-1].meaning == understand("take the jar")
    assert client.words[-1].meaning.clauses


# --- hi's port under people who mean no good; the bounds of its server: tests/page/test_limits.py -


def begun(client, data):
    """A connection that began a request, and says no more."""
    one = socket.create_connection(("127.0.0.1", client.address.port), timeout=30.0)
    one.sendall(data)
    return one


def answer(one):
    """All that is answered until the other side ends the connection; without that the time-out is a
    failure.
    """
    said = b""
    with contextlib.suppress(ConnectionError):
        while part := one.recv(4096):
            said += part
    return said


def test_a_person_is_served_beside_a_flood_of_slow_connections(client, monkeypatch):
    """The oldest that have not said who they are go; who waits with the token stays. No thread is
    made for any.
    """
    monkeypatch.setattr(loopback_server, "LOOK_S", 60.0)  # they go because there are too many
    answers = []
    waiter = threading.Thread(
        target=lambda: answers.append(client.ask("GET", "/events?wait=10")[0])
    )
    waiter.start()
    while not client.app.app.waiting:
        time.sleep(0.001)
    before = threading.active_count()
    flood = [begun(client, b"P") for _ in range(300)]
    assert client.ask("POST", "/say", b'{"text": "look around"}')[0] == 200
    assert threading.active_count() <= before + 1  # that which reads the sentence
    assert [answer(one) for one in flood[: 300 - MOST]] == [b""] * (300 - MOST)
    client.app.close()
    waiter.join(30.0)
    assert answers == [200]
    for one in flood:
        one.close()


def test_half_a_body_is_refused_in_time(client, monkeypatch):
    """408, also to who has the token."""
    monkeypatch.setattr(loopback_server, "BODY_S", 0.2)
    address = client.address
    head = (
        f"Host: 127.0.0.1:{address.port}\r\nAuthorization: Bearer"
        f" {address.token}\r\nContent-Length: 9\r\n\r\n{{"
    )
    with begun(client, f"POST /say HTTP/1.1\r\n{head}".encode()) as one:
        said = answer(one)
    assert b" 408 " in said.splitlines()[0]
    assert b"whole within" in said
    assert client.words == []


def test_what_is_no_http_is_refused_in_json(client):
    """As everything else is."""
    with begun(client, b"NONSENSE\r\n\r\n") as one:
        head, _, body = answer(one).partition(b"\r\n\r\n")
    assert b" 400 " in head.splitlines()[0]
    assert msgspec.json.decode(body, type=Problem).error
