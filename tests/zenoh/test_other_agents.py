"""`roco a2a` before a whole fleet: a task from the wish to its end, judged and recorded; and the
end of what goes on where the process ends.
"""

import asyncio
import contextlib
import json

import pytest
from roco_fleet import RocoFleet
from toy_fleet import wait_for

pytest.importorskip("a2a", reason="needs a2a-sdk (PyPI: pip install a2a-sdk[http-server])")
import httpx
from a2a.client import ClientConfig, ClientFactory
from a2a.client.card_resolver import A2ACardResolver
from a2a.helpers import get_message_text, new_data_message, new_text_message
from a2a.types import GetTaskRequest, Role, SendMessageRequest, TaskState

from companion.languages.cmd import Sentence, Stopped
from companion.skills.loop_messages import Mode
from companion.tasks.look_around.command import LookAround
from companion.tools.system import SYSTEM
from console.fleet.other_agents import WAY
from fipa_codec.languages import Reason
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Spoken

pytestmark = [pytest.mark.zenoh, pytest.mark.process, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    made = RocoFleet(tmp_path_factory.mktemp("site") / "run")
    yield made
    made.down()


@contextlib.asynccontextmanager
async def client(fleet):
    """Another agent, with the token."""
    address = json.loads((fleet.run / WAY.address_file).read_bytes())
    headers = {"Authorization": f"Bearer {address['token']}"}
    async with httpx.AsyncClient(headers=headers, timeout=150.0) as http:
        base = address["url"].removesuffix(WAY.path)
        card = await A2ACardResolver(http, base).get_agent_card()
        yield ClientFactory(ClientConfig(httpx_client=http)).create(card)


async def agreed(made, skill, **arguments):
    """Ask for a task and agree to it: its name, and what is told of it."""
    wish = new_data_message({"skill": skill, "arguments": arguments}, role=Role.ROLE_USER)
    (first, *_) = [one async for one in made.send_message(SendMessageRequest(message=wish))]
    task = first.task.id
    yes = new_data_message({"agree": True}, role=Role.ROLE_USER, task_id=task)
    return task, made.send_message(SendMessageRequest(message=yes))


def test_a_task_and_the_end_of_the_server(fleet):
    """People see the first as done, the second as cancelled; all is legal, and nothing is left."""
    serving = fleet.begin("a2a", "--port", "0")
    file = fleet.run / WAY.address_file
    wait_for(lambda: file.exists() or serving.poll() is not None, "it serves")

    async def test():
        async with asyncio.timeout(200.0), client(fleet) as made:
            task, told = await agreed(made, "lookAround")
            async for _ in told:
                pass
            done = await made.get_task(GetTaskRequest(id=task))
            assert done.status.state == TaskState.TASK_STATE_COMPLETED, done
            said = " ".join((await asyncio.to_thread(fleet.roco, "doctor")).split())
            assert "for who has the token in a2a.json" in said
            _, told = await agreed(made, "take", object="jar")
            async for one in told:
                if one.status_update.status.state == TaskState.TASK_STATE_WORKING:
                    break

    try:
        asyncio.run(test())
    finally:
        serving.terminate()
        serving.communicate(timeout=30.0)
    assert fleet.hi.tasks()[0].said == "assistant: look around"
    wait_for(lambda: fleet.hi.tasks()[-1].state == "cancelled", "the task is cancelled")
    assert not file.exists()
    verdicts = (fleet.run / "verdicts.jsonl").read_bytes().splitlines()
    told = [json.loads(line) for line in verdicts if b'"assistant"' in line]
    assert {one["verdict"] for one in told} == {"legal"}


def test_a_sentence_is_read_by_hi_and_recorded(fleet, tmp_path):
    """Its command is done once a person agrees; two commands are refused, a word that stops stops
    the robot. All of it is in the recording, and legal by the report.
    """
    serving = fleet.begin("a2a", "--port", "0")
    file = fleet.run / WAY.address_file
    wait_for(lambda: file.exists() or serving.poll() is not None, "it serves")
    texts = ("Could you look around, please?", "look around and take the jar", "Robot, halt now!")

    async def says(made, text, **more):
        message = new_text_message(text, role=Role.ROLE_USER, **more)
        (first, *_) = [one async for one in made.send_message(SendMessageRequest(message=message))]
        return await made.get_task(GetTaskRequest(id=first.task.id or more["task_id"]))

    async def test():
        async with asyncio.timeout(200.0), client(fleet) as made:
            asks = await says(made, texts[0])
            assert asks.status.state == TaskState.TASK_STATE_INPUT_REQUIRED, asks
            assert "to do: lookAround ()" in get_message_text(asks.status.message)
            done = await says(made, "agree", task_id=asks.id)
            assert done.status.state == TaskState.TASK_STATE_COMPLETED, done
            refused = await says(made, texts[1])
            assert refused.status.state == TaskState.TASK_STATE_REJECTED, refused
            stopped = await says(made, texts[2])
            assert stopped.status.state == TaskState.TASK_STATE_COMPLETED, stopped
            await asyncio.to_thread(
                wait_for, lambda: fleet.state().mode is Mode.STOPPED, "the loop holds the robot"
            )

    try:
        asyncio.run(test())
    finally:
        serving.terminate()
        serving.communicate(timeout=30.0)
    fleet.roco("release")
    assert fleet.hi.tasks()[-1].said == "assistant: look around"

    def recorded():
        records = mcap_file.read(fleet.run / TRAFFIC_FILE, SYSTEM).records
        said = [one for one in records if isinstance(one, Spoken)]
        query = [one for one in said if one.communicate.protocol == "query"]
        return [one.content for one in query if "assistant" in (one.sender, one.receiver)]

    wait_for(lambda: len(recorded()) == 6, "all of it is recorded")
    asked, read, several, why, halts, answer = recorded()
    assert [asked, several, halts] == [Sentence(text) for text in texts]
    assert read == LookAround()
    assert isinstance(why, Reason)
    assert isinstance(answer, Stopped)
    recording, told = str(fleet.run / TRAFFIC_FILE), tmp_path / "report.json"
    # it exits with 1: nobody asked for the usual task, which is to pour
    fleet.roco("report", recording, "--out", str(tmp_path), code=1, inside=False)
    assert json.loads(told.read_bytes())["judged"]["violations"] == []
