"""A desk of hi with an agent that answers at once, and a program that speaks to it."""

import http.client

import msgspec
import pytest

from companion.run_files import HI_FILE, HiAddress, HiEvent, Problem, TaskLine
from services.human_interface import server
from services.human_interface.device_messages import (
    Answer,
    CancelWanted,
    NewEvent,
    Sentence,
    Shown,
    StopRobot,
)

LINE = TaskLine("hi-1-3", "waiting", "I will look around.", "look around", 1.0)


class Client:
    """Speaks to a desk as a program would."""

    def __init__(self, run_dir):
        self.run_dir = run_dir
        self.words = []
        self.app = server.HttpDevice(self.post, run_dir)
        self.address = msgspec.json.decode((run_dir / HI_FILE).read_bytes(), type=HiAddress)

    def post(self, content, delay_s=0.0):
        """The agent's answer to a word, at once."""
        self.words.append(content)
        match content:
            case Sentence(ticket=ticket, text="status"):
                self.app.tell(Answer(ticket, problem="no coordinator yet", status=503))
            case Sentence(ticket=ticket, text="nie"):
                self.app.tell(
                    Answer(ticket, TaskLine("", "refused", "All right, then not.", "nie", 1.0))
                )
            case CancelWanted(ticket=ticket, task="hi-9-9"):
                self.app.tell(Answer(ticket, problem="there is no task 'hi-9-9'", status=404))
            case Sentence(text="silence"):
                pass
            # and that answer means that the robot is to stop
            case Sentence(ticket=ticket, text="that one"):
                self.app.tell(StopRobot(ticket, "that one"))
            case Sentence(ticket=ticket) | CancelWanted(ticket=ticket):
                self.app.tell(Answer(ticket, LINE))

    def tell_event(self, number):
        """The agent tells an event, and shows the tasks after it."""
        self.app.tell(NewEvent(HiEvent(number, float(number), "co", "waiting", "next")))
        self.app.tell(Shown((LINE,), number))

    def ask(self, verb, path, body=None, **headers):
        """Status and body."""
        connection = http.client.HTTPConnection("127.0.0.1", self.address.port, timeout=10.0)
        told = {"Authorization": f"Bearer {self.address.token}", **headers}
        try:
            connection.request(
                verb, path, body, {name: text for name, text in told.items() if text is not None}
            )
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
    client.app.close()
