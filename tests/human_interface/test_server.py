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
from msgspec.structs import replace
from typer.testing import CliRunner

from agent_runtime.io.run_files import STOP_FILE, STOP_HELD, STOP_RELEASED, listen_at
from companion import loopback_server
from companion.loopback_server import MOST
from companion.run_files import HI_FILE, Events, HiAddress, HiEvent, Problem, Question, Tasks
from companion.tools.verbs.hi import terminal
from console.__main__ import app
from services.human_interface import device_messages as device
from services.human_interface import server
from services.human_interface.grammar import understand

LOOK = b'{"text": "look around"}'


def test_the_address_is_for_its_owner_alone(client):
    """Mode 0600; gone when the device closes."""
    assert (client.run_dir / HI_FILE).stat().st_mode & 0o777 == 0o600
    assert len(client.address.token) >= 32
    assert os.listdir(client.run_dir) == [HI_FILE]


def test_say_and_cancel_reach_the_agent_and_bring_its_answer(client):
    """The agent's step gets a sentence with its meaning: it is read in the thread of the request.
    What the agent refuses keeps its status and its words.
    """
    assert client.say("take the jar").task == client.line("/cancel").task == "hi-1-3"
    sentence, cancel = client.words
    assert sentence.meaning == understand("take the jar")
    assert sentence.meaning.clauses
    assert isinstance(cancel, device.CancelWanted)
    assert client.refused("POST", "/say", b'{"text": "status"}') == (503, "no coordinator yet")
    assert client.refused("POST", "/cancel", b'{"task": "hi-9-9"}')[0] == 404


def test_when_a_sentence_is_wanted_goes_to_the_agent_as_seconds(client, monkeypatch):
    """A time of day by the clock of who says it: it is 15:00:30 in a place that is 20 minutes ahead
    of UTC.
    """
    now = 1e9 // 86400 * 86400 + 14 * 3600 + 40 * 60 + 30.0
    monkeypatch.setattr(server.time, "time", lambda: now)
    wanted = {
        "look around first, within ten minutes": (1, 600.0),
        "look around by 15:30": (0, 1770.0),
        "look around by half past three": (0, 1770.0),
        "look around": (0, 0.0),
    }
    for text in wanted:
        client.say(text, east_min=20)
    assert {said.text: (said.urgency, round(said.within_s, 6)) for said in client.words} == wanted
    assert {said.east_min for said in client.words} == {20}


def test_noon_is_another_time_elsewhere(client):
    """By the clock of the asker, else by hi's own."""
    left = []
    own = time.localtime().tm_gmtoff // 60
    for more in ({"east_min": own}, {}, {"east_min": own + 61}):
        client.say("look around at noon", **more)
        left.append(client.words[-1].later_s)
    assert client.words[-2].east_min == own
    assert (left[0] - left[1]) % 86400.0 < 60.0
    assert 3660.0 - 60.0 < (left[1] - left[2]) % 86400.0 <= 3660.0 + 60.0
    assert client.refused("POST", "/say", b'{"text": "look around", "east_min": 1441}')[0] == 400


def test_events_come_after_a_number_and_can_be_waited_for(client):
    """GET /events: at once what is there; else as soon as there is something."""
    client.tell_event(1)
    events = client.events()
    assert (events.next, [event.n for event in events.events]) == (1, [1])
    timer = threading.Timer(0.1, client.tell_event, (2,))
    timer.start()
    begun = time.monotonic()
    assert [event.n for event in client.events(f"?since={events.next}&wait=10").events] == [2]
    assert time.monotonic() - begun < 5.0
    timer.join()


def test_who_hears_of_an_event_finds_the_tasks_as_it_left_them(client):
    """Not those of before it: a page that asks for the tasks between the two would show these until
    the next event.
    """
    client.app.tell(device.NewEvent(HiEvent(1, 1.0, "co", "waiting", "next")))
    assert client.events("?wait=0.2") == Events(0, ())
    client.app.tell(device.Shown((client.say("look around"),), 1))
    assert [event.n for event in client.events("?wait=10").events] == [1]
    assert [line.task for line in client.tasks()] == ["hi-1-3"]


def test_after_a_restart_the_number_goes_on(client):
    """Older events are left out, and `next` is right to ask with."""
    client.app.tell(device.Shown((), 41))
    assert client.events("?since=7") == Events(41, ())


def test_without_the_token_or_with_another_host_nobody_is_served(client):
    """401 and 403, in words, and the agent hears nothing."""
    say = ("POST", "/say", LOOK)
    for wrong in (None, "Bearer wrong", "Bearer ä"):
        assert client.refused(*say, Authorization=wrong)[0] == 401, wrong
    assert client.refused(*say, Host="evil.example")[0] == 403
    assert client.ask(*say, Host=f"localhost:{client.address.port}")[0] == 200
    assert len(client.words) == 1


def test_a_body_that_is_not_what_is_wanted_is_refused_in_words(client):
    """400, and the agent hears nothing; also of what nests deep. 413 for what is too long: its
    sender can read it.
    """
    wrong = [
        b"", b"{", b"[]", b"{}", b'{"text": 3}', b'{"text": "a", "more": 1}', b'{"text": "\xff"}',
        b'{"text": "\\ud800"}', b'{"text": ' + b"[" * 4000,
    ]  # fmt: skip
    for body in wrong:
        status, words = client.refused("POST", "/say", body)
        assert (status, "text" in words) == (400, True), body[:50]
    assert [client.refused("POST", "/say", b" " * size)[0] for size in (4097, 60_000)] == [413, 413]
    assert client.words == []


def test_unknown_paths_verbs_and_queries_are_refused(client):
    """404 and 405, naming what there is; 400 for a query that is no number."""
    status, words = client.refused("GET", "/dance")
    assert (status, "/say" in words) == (404, True)
    for verb, path in (("GET", "/say"), ("POST", "/tasks"), ("BREW", "/tasks")):
        assert client.refused(verb, path)[0] == 405, (verb, path)
    for query in ("since=x", "wait=x", "since=-1", "wait=11", "wait=nan", "what=1"):
        assert client.refused("GET", f"/events?{query}")[0] == 400, query


def test_an_agent_that_says_nothing_ends_in_503(client, monkeypatch):
    """Every wait ends."""
    monkeypatch.setattr(server, "ANSWER_S", 0.1)
    status, words = client.refused("POST", "/say", b'{"text": "silence"}')
    assert (status, "/tasks" in words) == (503, True)


def test_it_listens_where_it_is_told(tmp_path):
    """A container is reached at a fixed port; people ask under the same port, so the check of Host
    holds.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    device_of_hi = server.HttpDevice(lambda content: None, tmp_path, listen_at(f"127.0.0.1:{port}"))
    try:
        told = msgspec.json.decode((tmp_path / HI_FILE).read_bytes(), type=HiAddress)
        assert told.port == port
        socket.create_connection(("127.0.0.1", port), timeout=5.0).close()
    finally:
        device_of_hi.close()


def test_an_address_that_is_taken_is_named_with_its_variable(tmp_path):
    """`roco up` shows these words where hi is given up."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        words = f"127.0.0.1:{port} cannot be listened at: Address already in use; ROCO_HTTP names"
        with pytest.raises(OSError, match=re.escape(f"{words} another address")):
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


def flag(client):
    """The byte that the loop reads."""
    return (client.run_dir / STOP_FILE).read_bytes()


def roco_say(robot, text):
    done = CliRunner().invoke(app, ["say", text, "--run-dir", str(robot.run_dir)])
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_stop_needs_no_agent_and_no_room(robot, monkeypatch):
    """The agent answers nobody, and as many wait as may: the byte is set before the answer."""
    monkeypatch.setattr(robot.app.app, "_post", lambda content: None)
    monkeypatch.setattr(robot.app.app, "waiting", server.AT_ONCE)
    assert robot.refused("GET", "/events?wait=1")[0] == 503
    for path, body in STOPS:
        line = robot.line(path, body)
        assert (line.state, flag(robot)) == ("stopped", STOP_HELD), body
        assert "roco release" in line.text
        assert (robot.line("/release").state, flag(robot)) == ("released", STOP_RELEASED), body


def test_a_call_for_help_stops_and_is_told_what_can_be_said(robot):
    """By hi, and by `roco say`, which sets the flag itself; in the language of the call."""
    for words, told in (("help, I've fallen", "put down the X"), ("pomocy!", "odłóż X")):
        line = robot.say(words)
        assert (line.state, told in line.text, flag(robot)) == ("stopped", True, STOP_HELD)
        robot.line("/release")
        assert (told in roco_say(robot, words), flag(robot)) == (True, STOP_HELD)
        robot.line("/release")


def asked(robot, asker, for_s=30.0):
    """hi has asked somebody something."""
    question = Question(asker, time.time() + for_s, ("yes", "no", "tak", "nie"))
    robot.app.tell(device.Shown((), 0, questions=(question,)))


def test_an_answer_of_who_was_asked_goes_to_the_agent_and_stops_nothing(robot):
    """With the asker, and when it was said."""
    asked(robot, "kitchen")
    for answer in ("no", "nie", "Nie!", "tak"):
        robot.say(answer, asker="kitchen")
        said = robot.words[-1]
        assert (said.text, said.asker) == (answer, "kitchen")
        assert abs(said.at - time.time()) < 60.0
        assert flag(robot) == STOP_RELEASED, answer


def test_whatever_is_no_answer_of_who_was_asked_stops(robot):
    """Another one's no, a no that comes too late, and every other stop word while the question is
    open.
    """
    stops = ("stop", "no no", "nie, nie", "nie bierz", "no, stop", "stój", "help")
    others = [("nie", "hall", 30.0), ("no", "", 30.0), ("nie", "kitchen", -1.0)]
    for text, asker, for_s in (*others, *((text, "kitchen", 30.0) for text in stops)):
        asked(robot, "kitchen", for_s)
        robot.line("/release")
        state = robot.say(text, asker=asker).state
        assert (state, flag(robot)) == ("stopped", STOP_HELD), (text, asker)


def test_a_terminal_that_was_asked_answers_and_another_one_stops(robot):
    """`roco say no`: the terminal is told by its session, which a further call in it shares."""
    command = [sys.executable, "-m", "console", "say", "nie", "--run-dir", str(robot.run_dir)]
    asked(robot, terminal())
    subprocess.run(command, capture_output=True, timeout=50, check=False)
    said = robot.words[-1]
    assert (said.text, said.asker, flag(robot)) == ("nie", terminal(), STOP_RELEASED)
    subprocess.run(command, capture_output=True, timeout=50, check=True, start_new_session=True)
    assert flag(robot) == STOP_HELD


def test_a_terminal_tells_its_time_zone(robot, monkeypatch):
    """`roco say`: noon is noon where it is called."""
    line = replace(robot.say("look around"), accepted=True)
    robot.app.tell(device.Shown((line,), 0))
    for zone, east_min in (("<+0545>-5:45", 345), ("EST5", -300), ("UTC", 0)):
        monkeypatch.setenv("TZ", zone)
        time.tzset()
        roco_say(robot, "look around at noon")
        said = robot.words[-1]
        assert said.east_min == east_min
        noon = (said.at + said.later_s + 60 * east_min) % 86400.0
        assert noon == pytest.approx(43200.0, abs=0.01)
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
    roco_say(robot, "nie")
    assert (flag(robot), late) == (STOP_HELD, [])


def test_the_agent_hears_of_a_stop_and_of_its_end(robot):
    """So that it is told to others; it reads no files, so a sentence comes with that."""
    robot.say("look around")
    robot.line("/stop")
    robot.say("look around")
    robot.line("/release")
    before, stop, meanwhile, release = robot.words
    assert [(one.held, one.reached) for one in (stop, release)] == [(True, True), (False, True)]
    assert [before.held, meanwhile.held] == [False, True]


def test_a_robot_out_of_reach_is_not_called_stopped(client):
    """Its loop has another run folder, as in containers: 503, what was done instead, and what would
    stop it.
    """
    for path, body in (*STOPS, ("/release", b"")):
        status, words = client.refused("POST", path, body)
        assert status == 503
        assert ("roco release" if path == "/release" else "roco stop") in words
        assert client.words[-1] == device.Halted(path != "/release", False, words)
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
    assert (robot.say("that one").state, flag(robot)) == ("stopped", STOP_HELD)


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
    """The oldest that have not said who they are go; who waits with the token stays, and is
    answered when the device closes. No thread is made for any.
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
    client.say("look around")
    assert threading.active_count() <= before + 1  # that which reads the sentence
    assert [answer(one) for one in flood[: 300 - MOST]] == [b""] * (300 - MOST)
    client.app.close()
    waiter.join(5.0)
    assert answers == [200]
    assert not (client.run_dir / HI_FILE).exists()
    for one in flood:
        one.close()


def test_half_a_body_is_refused_in_time(client, monkeypatch):
    """408, also to who has the token."""
    monkeypatch.setattr(loopback_server, "BODY_S", 0.2)
    address = client.address
    head = f"Host: 127.0.0.1:{address.port}\r\nAuthorization: Bearer {address.token}\r\n"
    request = f"POST /say HTTP/1.1\r\n{head}Content-Length: 9\r\n\r\n{{"
    with begun(client, request.encode()) as one:
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
