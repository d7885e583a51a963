"""A device of hi with an agent that answers at once, and a program that speaks to it. Makes the
scripted partners of tests/fleet importable.
"""

import http.client
import sys
from pathlib import Path

import msgspec
import pytest

from agent_runtime.io.run_files import STOP_FILE, STOP_RELEASED
from companion.run_files import (
    HI_FILE,
    SLOTS_FILE,
    Events,
    HiAddress,
    HiEvent,
    Problem,
    TaskLine,
    Tasks,
)
from services.human_interface import device_messages as device
from services.human_interface import server

sys.path.insert(0, str(Path(__file__).parents[1] / "fleet"))

LINE = TaskLine("hi-1-3", "waiting", "I will look around.", "look around", 1.0)


class Client:
    """Speaks to the device as a program would."""

    def __init__(self, run_dir):
        self.run_dir = run_dir
        self.words = []
        self.app = server.HttpDevice(self.post, run_dir)
        self.address = msgspec.json.decode((run_dir / HI_FILE).read_bytes(), type=HiAddress)

    def post(self, content):
        """The agent's answer to a word, at once."""
        self.words.append(content)
        match content:
            case device.Sentence(text="silence"):
                return
            case device.Sentence(ticket=ticket, text="status"):
                answer = device.Answer(ticket, problem="no coordinator yet", status=503)
            case device.Sentence(ticket=ticket, text="nie"):
                no = TaskLine("", "refused", "All right, then not.", "nie", 1.0)
                answer = device.Answer(ticket, no)
            case device.CancelWanted(ticket=ticket, task="hi-9-9"):
                answer = device.Answer(ticket, problem="there is no task 'hi-9-9'", status=404)
            # and that answer means that the robot is to stop
            case device.Sentence(ticket=ticket, text="that one"):
                answer = device.StopRobot(ticket, "that one")
            case device.Sentence(ticket=ticket) | device.CancelWanted(ticket=ticket):
                answer = device.Answer(ticket, LINE)
            case _:
                return
        self.app.tell(answer)

    def tell_event(self, number):
        """The agent tells an event, and shows the tasks after it."""
        event = HiEvent(number, float(number), "co", "waiting", "next")
        self.app.tell(device.NewEvent(event))
        self.app.tell(device.Shown((LINE,), number))

    def ask(self, verb, path, body=None, **headers):
        """Status and body."""
        connection = http.client.HTTPConnection("127.0.0.1", self.address.port, timeout=10.0)
        told = {"Authorization": f"Bearer {self.address.token}", **headers}
        told = {name: text for name, text in told.items() if text is not None}
        try:
            connection.request(verb, path, body, told)
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def say(self, text, **more):
        """The line of the answer to a sentence."""
        return self.line("/say", msgspec.json.encode({"text": text} | more))

    def line(self, path, body=b"{}"):
        """The line of the answer to a request that is served."""
        status, data = self.ask("POST", path, body)
        assert status == 200, data
        return msgspec.json.decode(data, type=TaskLine)

    def events(self, query=""):
        return msgspec.json.decode(self.ask("GET", f"/events{query}")[1], type=Events)

    def tasks(self):
        return msgspec.json.decode(self.ask("GET", "/tasks")[1], type=Tasks).tasks

    def refused(self, verb, path, body=None, **headers):
        """Status and the sentence of a refusal."""
        status, data = self.ask(verb, path, body, **headers)
        return status, msgspec.json.decode(data, type=Problem).error


@pytest.fixture
def client(tmp_path):
    """A device and who speaks to it."""
    client = Client(tmp_path)
    yield client
    client.app.close()


@pytest.fixture
def robot(client):
    """A client whose device shares its run folder with a control loop."""
    (client.run_dir / SLOTS_FILE).touch()
    (client.run_dir / STOP_FILE).write_bytes(STOP_RELEASED)
    return client
