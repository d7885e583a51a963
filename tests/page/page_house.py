"""The page as a process, before a hi that is real (agent and HTTP) with a coordinator that says
what the test wants.
"""

import http.client
import os
import signal
import subprocess
import sys
import threading
import time
from urllib.parse import urlencode

import msgspec
from scripted_partner import Puppet

from agent_runtime.io.devices import Called
from agent_runtime.io.run_files import STOP_FILE
from agent_runtime.testing.memory_bus import MemoryBus
from companion.design import wiring
from companion.languages.cmd import TaskReport, TaskState
from companion.languages.facts import Kind as Why
from companion.languages.facts import fact
from companion.languages.hfsm import Place, Step
from companion.languages.values import Side
from companion.run_files import PAGE_FILE, SLOTS_FILE, PageAddress, Pairing
from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from services.human_interface.behaviours import agent
from services.human_interface.device_messages import Sentence
from services.human_interface.grammar import understand
from services.human_interface.server import HttpDevice

WITHIN_S = 20.0
STEPS = (Step("take", ("jar_1",)), Step("carry", ("jar_1",)), Step("take", ("bowl_1",)))


def place(number, act):
    """A place in the step of this number."""
    step = STEPS[number - 1]
    return Place((f"{step.does} {step.things[0]}", act), step, act, Side.LEFT)


class House:
    """hi of a run folder with a coordinator that takes every task; a robot's loop has its flag
    there.
    """

    def __init__(self, run):
        self.run, self.asked, self.cancelled = run, [], []
        (run / SLOTS_FILE).touch()
        (run / STOP_FILE).write_bytes(b"\0")
        self._lock, self._inside = threading.RLock(), False
        self._wires = MemoryBus()
        self.open()

        def told(word):
            self.desk.tell(word)
            return ()

        self._wires.add(agent(), wiring("hi", "test"), lambda post: Called(post, told))
        self._wires.add(Puppet("co", self._answer).agent(), wiring("co", "test"))
        self._wires.run_for(0.05)

    @property
    def now(self):
        """What its clock shows."""
        return self._wires.now

    def open(self):
        """hi listens, at a new port and with a new token."""
        self.desk = HttpDevice(self._post, self.run)

    def _post(self, word):
        with self._lock:
            self._wires.post("hi", word)
            if not self._inside:
                self._inside = True
                self._wires.run_for(0.05)
                self._inside = False

    def _answer(self, turn, event):
        task, act = event.conversation, event.communicate.performative
        if act is P.REQUEST:
            self.asked.append((task, event.content))
            turn.say(task, P.AGREE, TaskReport(TaskState.WAITING, (fact(Why.IS_NEXT),)))
        elif act is P.CANCEL:
            self.cancelled.append(task)
            told = TaskReport(TaskState.CANCELLED, (fact(Why.NOT_BEGUN_YET),))
            turn.say(task, P.INFORM, told, kind=Kind.CANCEL)

    def report(self, task, state, *why, **more):
        """The coordinator reports on a task."""
        kind = P.FAILURE if state is TaskState.FAILED else P.INFORM
        with self._lock:
            told = TaskReport(state, why, **more)
            self._wires.post("co", lambda turn: turn.say(task, kind, told))
            self._wires.run_for(0.05)

    def post(self, text):
        """Somebody else says a sentence."""
        self._post(Sentence("", text, understand(text), asker="other", at=self.now))

    def running(self, task="hi-1-1", number=1, act="Grasp", steps=STEPS, rest=0.0):
        """A task is under way."""
        why = fact(Why.PLAN_TAKES, 1, 48.0)
        self.report(task, TaskState.RUNNING, why, steps=steps, rest=rest)
        self.report(task, TaskState.RUNNING, at=place(number, act), number=number)

    @property
    def held(self):
        """Whether the robot is stopped."""
        return (self.run / STOP_FILE).read_bytes() == b"\1"


class PageProcess:
    """`python -m services.page` of a run folder; `connect`: where its router is, if it has one;
    `settings`: more of its environment.
    """

    def __init__(self, run, connect="tcp/127.0.0.1:1", **settings):
        self.run, self.connect, self.settings = run, connect, settings
        self.start()

    def start(self):
        """Start it, and wait until it says so; what one before it said counts for nothing, as in
        deploy/healthy.
        """
        before = self.said_ready()
        settings = {"ROCO_RUN_DIR": str(self.run), "ROCO_CONNECT": self.connect}
        settings |= {"PATH": os.environ["PATH"]} | self.settings
        with (self.run / "page.log").open("ab") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "services.page"], env=settings, stdout=log, stderr=log
            )
        wait_for(
            lambda: self.said_ready() > before or self.process.poll() is not None,
            "the page listens",
        )
        assert self.process.poll() is None, (self.run / "page.log").read_text()
        self.address = msgspec.json.decode((self.run / PAGE_FILE).read_bytes(), type=PageAddress)
        self.url = f"http://127.0.0.1:{self.address.port}"

    def said_ready(self):
        """Return when a page of this run folder reported ready [ns], 0 for never."""
        try:
            return (self.run / "page.ready").stat().st_mtime_ns
        except FileNotFoundError:
            return 0

    def kill(self):
        """kill -9."""
        self.process.kill()
        self.process.wait()

    def end(self):
        """SIGTERM; the exit code."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=WITHIN_S)

    def code(self):
        """A new code, as `roco page` gets it."""
        status, data, _ = self.ask("POST", "/code", Authorization=f"Bearer {self.address.token}")
        assert status == 200, data
        return msgspec.json.decode(data, type=Pairing).code

    def paired(self):
        """The Cookie header of a newly paired browser."""
        status, _, headers = self.form("/pair", {"code": self.code()})
        assert status == 200
        return headers["set-cookie"].partition(";")[0]

    def form(self, path, fields, cookie="", **headers):
        """A form, as this page sends it; other headers replace its own, None leaves one out."""
        form = "application/x-www-form-urlencoded"
        told = {"Origin": self.url, "Accept": "application/json", "Content-Type": form}
        told |= {"Cookie": cookie} if cookie else {}
        return self.ask("POST", path, urlencode(fields), **(told | headers))

    def ask(self, verb, path, body=None, **headers):
        """Status, body and headers of an answer."""
        connection = http.client.HTTPConnection("127.0.0.1", self.address.port, timeout=WITHIN_S)
        told = {name.replace("_", "-"): text for name, text in headers.items() if text is not None}
        try:
            connection.request(verb, path, body, told)
            answer = connection.getresponse()
            told = {name.lower(): text for name, text in answer.getheaders()}
            return answer.status, answer.read(), told
        finally:
            connection.close()


def wait_for(condition, what, within_s=WITHIN_S):
    """Wait until it holds."""
    end = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < end, f"not within {within_s:g} s: {what}"
        time.sleep(0.02)
