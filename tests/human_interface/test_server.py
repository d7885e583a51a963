"""docs/http.md over a real socket, with an agent that answers at once, late, or never."""

import http.client
import os
import socket
import threading
import time

import msgspec
import pytest

from companion.run_files import HI_FILE, Events, HiAddress, HiEvent, Problem, TaskLine, Tasks
from services.human_interface import server
from services.human_interface.local import Answer, CancelWanted, Said, Shown, Told

LINE = TaskLine("hi-1-3", "waiting", "I will look around.", "look around", 1.0)


class Client:
    """Speaks to a desk as a program would."""

    def __init__(self, run_dir):
        self.run_dir = run_dir
        self.words = []
        self.desk = server.HttpDevice(self.post, run_dir)
        self.address = msgspec.json.decode((run_dir / HI_FILE).read_bytes(), type=HiAddress)

    def post(self, content, delay_s=0.0):
        """The agent's answer to a word, at once."""
        self.words.append(content)
        match content:
            case Said(ticket=ticket, text="status"):
                self.desk.tell(Answer(ticket, problem="no coordinator yet", status=503))
            case CancelWanted(ticket=ticket, task="hi-9-9"):
                self.desk.tell(Answer(ticket, problem="there is no task 'hi-9-9'", status=404))
            case Said(text="silence"):
                pass
            case Said(ticket=ticket) | CancelWanted(ticket=ticket):
                self.desk.tell(Answer(ticket, LINE))

    def ask(self, verb, path, body=None, **headers):
        """Status and body."""
        connection = http.client.HTTPConnection("127.0.0.1", self.address.port, timeout=10.0)
        told = {"Authorization": f"Bearer {self.address.token}", **headers}
        try:
            connection.request(verb, path, body, {name: text for name, text in told.items() if text is not None})
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def refused(self, verb, path, body=None, **headers):
        """Status and the sentence of a refusal."""
        status, data = self.ask(verb, path, body, **headers)
        return status, msgspec.json.decode(data, type=Problem).error


@pytest.fixture
def client(tmp_path):
    """A desk and who speaks to it."""
    client = Client(tmp_path)
    yield client
    client.desk.close()


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


def test_closing_ends_the_waits(tmp_path):
    """A request for events is answered when the desk closes."""
    client = Client(tmp_path)
    answers = []
    waiter = threading.Thread(target=lambda: answers.append(client.ask("GET", "/events?wait=10")[0]))
    waiter.start()
    while client.desk._server.room._value == server.AT_ONCE:
        time.sleep(0.001)
    client.desk.close()
    waiter.join(5.0)
    assert answers == [200]
    assert not (tmp_path / HI_FILE).exists()


def test_it_listens_where_it_is_told(tmp_path):
    """A container is reached at a fixed port; people ask under the same port, so the check of Host holds."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    desk = server.HttpDevice(lambda content: None, tmp_path, server.listen_at(f"127.0.0.1:{port}"))
    try:
        told = msgspec.json.decode((tmp_path / HI_FILE).read_bytes(), type=HiAddress)
        assert told.port == port
        with socket.create_connection(("127.0.0.1", port), timeout=5.0):
            pass
    finally:
        desk.close()


def test_without_a_word_it_listens_on_loopback_only():
    """Who wants more says so."""
    assert server.listen_at("") == ("127.0.0.1", 0)


@pytest.mark.parametrize("text", ["8350", ":8350", "0.0.0.0:", "0.0.0.0:http", "0.0.0.0:65536", "0.0.0.0:-1"])
def test_what_is_no_address_is_named(text):
    """With what would have been right."""
    with pytest.raises(ValueError, match=r"is not an address to listen at, expected host:port"):
        server.listen_at(text)
