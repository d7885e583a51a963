"""Words of a holder of hi's key under its next numbers: co takes hi's task all the same, and both
tell of it.
"""

import json

import msgspec
import pytest
import zenoh
from key_floods import REQUEST, request
from secured_fleet import SYSTEM, serve, session
from toy_fleet import Fleet, wait_for

from agent_runtime.core.state import Record
from agent_runtime.core.wiring import life, service_key
from agent_runtime.io.journal import journal_file, last_record
from companion.run_files import HI_FILE, HiAddress
from companion.tools.verbs.hi import Hi

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]
TOLD = "another speaker"


def record(fleet: Fleet, name: str) -> Record:
    """Return the last record of an agent's journal."""
    data = last_record(journal_file(fleet.run, name).read_bytes())
    return msgspec.msgpack.decode(data or b"", type=Record)


def lines(fleet: Fleet, name: str, event: str) -> list[dict[str, object]]:
    """The lines of an agent's log that have this event."""
    every = [
        json.loads(line) for line in (fleet.run / "logs" / f"{name}.jsonl").read_text().splitlines()
    ]
    return [line for line in every if line["event"] == event]


class Thief:
    """A session with hi's key; it says requests in hi's name, as hi's journal says them, or as
    another one.
    """

    def __init__(self, fleet: Fleet, journal: str = "") -> None:
        self._fleet, self._session, self._journal = fleet, session(fleet, "hi", "co"), journal
        self._names = (
            f"{journal or record(fleet, 'hi').journal}/{record(fleet, 'co').journal}".encode()
        )
        self._heard: list[object] = []

    def says(self, number: int) -> None:
        """Put a request under a number."""
        self._session.put(
            REQUEST,
            request(number, conversation=f"thief-{number}"),
            congestion_control=zenoh.CongestionControl.BLOCK,
            attachment=self._names,
        )

    def lives(self) -> None:
        """Declare a token of a higher life than hi's, with the journal's name."""
        key = service_key(SYSTEM, "alive", "hi", life(99, self._journal))
        self._heard.append(self._session.liveliness().declare_token(key))

    def always_says_the_next(self) -> None:
        """From now on, as soon as co receipts a number."""

        def answer(sample: zenoh.Sample) -> None:
            taken = msgspec.msgpack.decode(sample.payload.to_bytes())["taken"]
            self.says(taken + 1)

        self._heard.append(
            self._session.declare_subscriber(f"roco/{SYSTEM}/_/receipt/co/hi", answer)
        )

    def close(self) -> None:
        """End the session."""
        self._session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def hi(router: Fleet) -> Hi:
    """A person's way to hi, which sees co."""
    serve(router, "co", "services.coordinator")
    serve(router, "hi", "services.human_interface")
    wait_for(lambda: (router.run / HI_FILE).exists(), f"hi listens\n{router.logs()}")
    wait_for(lambda: "co" in router.beat("hi").peers, f"hi sees co\n{router.logs()}")
    wait_for(lambda: "hi" in router.beat("co").peers, "co sees hi")
    return Hi(msgspec.json.decode((router.run / HI_FILE).read_bytes(), type=HiAddress))


def task_is_known(fleet: Fleet, task: str) -> bool:
    """Whether co took the request of the task, and hi has its answer."""
    return all(
        any(line["conversation"] == task for line in lines(fleet, name, "received"))
        for name in ("co", "hi")
    )


@pytest.mark.parametrize("stolen", [1, 40], ids=["one number", "more than co remembers"])
def test_words_under_his_next_numbers_do_not_lose_his_task(
    router: Fleet, hi: Hi, stolen: int
) -> None:
    """Said before hi's own: hi learns of them by their receipts, and tells; its task has the next
    number then.
    """
    thief = Thief(router)
    for number in range(1, stolen + 1):
        thief.says(number)
    wait_for(
        lambda: record(router, "co").taken.get("hi") == stolen, "co has taken the thief's words"
    )
    wait_for(lambda: lines(router, "hi", TOLD), "hi tells that somebody else has its key")
    assert "roco keys revoke hi" in str(lines(router, "hi", TOLD)[0]["why"])
    wait_for(
        lambda: router.beat("hi").counts.get(TOLD) == stolen,
        "the heartbeat counts them: hi has all receipts",
    )
    task = hi.say("look around").task
    wait_for(lambda: task_is_known(router, task), f"co has hi's task\n{router.logs()}")
    assert record(router, "co").taken["hi"] == stolen + 1
    thief.close()


def test_words_said_while_he_was_away_do_not_lose_his_task(router: Fleet, hi: Hi) -> None:
    """hi did not hear their receipts: its word is refused, and said again under another number."""
    router.kill("hi")
    wait_for(lambda: "hi" not in router.beat("co").peers, "co sees that hi is gone")
    thief = Thief(router)
    for number in (1, 2):
        thief.says(number)
    wait_for(lambda: record(router, "co").taken.get("hi") == 2, "co has taken the thief's words")
    (router.run / HI_FILE).unlink()
    serve(router, "hi", "services.human_interface")
    wait_for(lambda: (router.run / HI_FILE).exists(), "hi listens")
    again = Hi(msgspec.json.decode((router.run / HI_FILE).read_bytes(), type=HiAddress))
    wait_for(
        lambda: "co" in router.beat("hi").peers and router.beat("hi").incarnation == 2, "hi sees co"
    )
    task = again.say("look around").task
    wait_for(lambda: task_is_known(router, task), f"co has hi's task\n{router.logs()}")
    assert "two words under its number 1" in str(lines(router, "co", TOLD)[0]["why"])
    assert "is said again as 3" in str(lines(router, "hi", TOLD)[0]["why"])
    assert (
        len([line for line in lines(router, "co", "received") if line["conversation"] == task]) == 1
    )
    thief.close()


def test_whoever_always_says_the_next_number_does_not_keep_him_out(router: Fleet, hi: Hi) -> None:
    """The thief needs no disk and answers each receipt at once: hi's numbers pass it."""
    thief = Thief(router)
    thief.always_says_the_next()
    thief.says(1)
    wait_for(lambda: record(router, "co").taken.get("hi", 0) > 20, "the thief goes on and on")
    task = hi.say("look around").task
    wait_for(lambda: task_is_known(router, task), f"co has hi's task\n{router.logs()}")
    thief.close()


def test_a_life_of_another_journal_does_not_keep_him_out(router: Fleet, hi: Hi) -> None:
    """While hi's own token is there, the thief's token and its words count for nothing."""
    thief = Thief(router, "another")
    thief.lives()
    thief.says(1)
    wait_for(
        lambda: lines(router, "co", "of another journal"),
        "co has the thief's token, and its word after it",
    )
    task = hi.say("look around").task
    wait_for(lambda: task_is_known(router, task), f"co has hi's task\n{router.logs()}")
    assert record(router, "co").journals["hi"] == record(router, "hi").journal
    assert not lines(router, "co", "lost its memory")
    thief.close()
