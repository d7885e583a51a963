"""Words of a holder of hi's key under its next numbers: co takes hi's task all the same, and both
tell of it.
"""

import msgspec
import pytest
from key_floods import REQUEST, request
from secured_fleet import KeyHolder, logged, serve
from toy_fleet import Fleet, wait_for

from agent_runtime.core.state import Record
from agent_runtime.core.wiring import life
from agent_runtime.io.journal import journal_file, last_record
from companion.run_files import HI_FILE, HiAddress
from companion.tools.verbs.hi import Hi

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]
TOLD = "another speaker"


def record(fleet: Fleet, name: str) -> Record:
    """Return the last record of an agent's journal."""
    data = last_record(journal_file(fleet.run, name).read_bytes())
    return msgspec.msgpack.decode(data or b"", type=Record)


class Thief(KeyHolder):
    """Holder of hi's key; it says requests in hi's name, as hi's journal says them, or as another
    one.
    """

    def __init__(self, fleet: Fleet, journal: str = "") -> None:
        super().__init__(fleet, "hi")
        names = journal or record(fleet, "hi").journal, record(fleet, "co").journal
        self._names = "/".join(names).encode()

    def says(self, number: int) -> None:
        """Put a request under a number."""
        said = request(number, conversation=f"thief-{number}")
        self.put(REQUEST, said, attachment=self._names)


@pytest.fixture
def hi(router: Fleet) -> Hi:
    """A person's way to hi, which sees co."""
    serve(router, "co", "hi")
    return seeing(router, 1)


def seeing(router: Fleet, life: int) -> Hi:
    """Return a person's way to this life of hi, once it and co see each other."""
    router.wait((router.run / HI_FILE).exists, "hi listens")
    router.wait(
        lambda: "co" in router.beat("hi").peers and router.beat("hi").incarnation == life,
        "hi sees co",
    )
    wait_for(lambda: "hi" in router.beat("co").peers, "co sees hi")
    return Hi(msgspec.json.decode((router.run / HI_FILE).read_bytes(), type=HiAddress))


def looks(router: Fleet, hi: Hi, times: int = 1) -> str:
    """co takes the request of a person's task, and hi has its answer; its name. `times`: how often
    the person says it, as hi asks for, where co does not know whether it has it.
    """
    for last in (*(times - 1) * (False,), True):
        task = hi.say("look around").task
        if _taken(router, task, last=last):
            break
    return task


def _taken(router: Fleet, task: str, *, last: bool) -> bool:
    """Whether co takes it and hi has the answer. Only the `last` one may not be given up."""

    def known(name: str, event: str) -> bool:
        return any(line["conversation"] == task for line in logged(router, name, event))

    def taken() -> bool:
        return known("co", "received") and known("hi", "received")

    router.wait(lambda: taken() or (not last and known("hi", "broken")), "co has hi's task")
    return taken()


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
    wait_for(lambda: record(router, "co").taken.get("hi") == stolen, "co has the thief's words")
    wait_for(lambda: logged(router, "hi", TOLD), "hi tells that somebody else has its key")
    assert "roco keys revoke hi" in logged(router, "hi", TOLD)[0]["why"]
    wait_for(lambda: router.beat("hi").counts.get(TOLD) == stolen, "hi has all receipts")
    looks(router, hi)
    assert record(router, "co").taken["hi"] == stolen + 1


@pytest.mark.usefixtures("hi")
def test_words_said_while_he_was_away_do_not_lose_his_task(router: Fleet) -> None:
    """hi did not hear their receipts: its word is refused, and said again under another number."""
    router.kill("hi")
    wait_for(lambda: "hi" not in router.beat("co").peers, "co sees that hi is gone")
    thief = Thief(router)
    for number in (1, 2):
        thief.says(number)
    wait_for(lambda: record(router, "co").taken.get("hi") == 2, "co has taken the thief's words")
    (router.run / HI_FILE).unlink()
    serve(router, "hi")
    task = looks(router, seeing(router, 2))
    assert "two words under its number 1" in logged(router, "co", TOLD)[0]["why"]
    assert "is said again as 3" in logged(router, "hi", TOLD)[0]["why"]
    received = [line["conversation"] for line in logged(router, "co", "received")]
    assert received.count(task) == 1


def test_whoever_always_says_the_next_number_does_not_keep_him_out(router: Fleet, hi: Hi) -> None:
    """The thief needs no disk and answers each receipt at once: hi's numbers pass it.

    Where the thief said so much that co does not know hi's first word any more, hi asks the person
    to say it again; its numbers lie farther on each time.
    """
    thief = Thief(router)
    thief.hears(
        "_/receipt/co/hi", lambda data: thief.says(msgspec.msgpack.decode(data)["taken"] + 1)
    )
    thief.says(1)
    wait_for(lambda: record(router, "co").taken.get("hi", 0) > 20, "the thief goes on and on")
    looks(router, hi, times=4)


def test_a_life_of_another_journal_does_not_keep_him_out(router: Fleet, hi: Hi) -> None:
    """While hi's own token is there, the thief's token and its words count for nothing."""
    thief = Thief(router, "another")
    thief.lives(life(99, "another"))
    thief.says(1)
    wait_for(lambda: logged(router, "co", "of another journal"), "co has the thief's token")
    looks(router, hi)
    assert record(router, "co").journals["hi"] == record(router, "hi").journal
    assert not logged(router, "co", "lost its memory")
