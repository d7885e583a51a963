"""Several robots at one site: at one router, or each at its own with the routers linked. Nothing of one reaches an
agent of another; a recorder at any of the routers hears all.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
import zenoh
from neighbours import KINDS, Cable, Pair
from toy_fleet import wait_for

from agent_runtime.io import issuing
from agent_runtime.io.incoming import Token
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls, rights_of, router_tls
from agent_runtime.io.sessions import LEASE_MS, client_config, free_endpoint, open_router
from agent_runtime.io.tap import Sample, Tap, open_tap
from companion.design import DESIGN
from operate.recording import mcap_file
from operate.recording.records import Record, Resumed, Spoken

pytestmark = pytest.mark.zenoh
SYSTEMS = ("velma1", "velma2")
SAID = len(("communicate", "receipt", "ping", "pong", *KINDS))
"""One of everything that `Pair.talk` says, each way."""
PINGS = len(("ping", "pong"))
"""No agent takes them here: what they say is not a channel. A recorder hears them."""


class Site(msgspec.Struct):
    """Two pairs, and what a recorder hears at the second one's router."""

    first: Pair
    second: Pair
    samples: list[Sample]


@pytest.fixture(params=["one router", "one router, rights", "linked", "linked, rights"])
def site(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Site]:
    """Both robots at one router, or each at its own and the second router joins the first; open to all, or not."""
    linked, rights = "linked" in request.param, "rights" in request.param
    keys = tmp_path if rights else None
    near, far = (free_endpoint().replace("tcp/", "tls/" if rights else "tcp/") for _ in SYSTEMS)
    if keys:
        issuing.issue(keys, DESIGN, SYSTEMS, linked=linked)
    routers = [opened(near, (), keys, "velma1", linked)]
    if linked:
        routers.append(opened(far, (near,), keys, "velma2", linked))
    pairs = Pair("velma1", near, keys), Pair("velma2", far if linked else near, keys)
    samples, tap = tapped(Options(connect=far if linked else near, systems=SYSTEMS, keys=keys))
    yield Site(*pairs, samples)
    for one in (tap, *pairs, *routers):
        one.close()


def tapped(options: Options) -> tuple[list[Sample], Tap]:
    """Return the samples a recorder hears from now on, and its tap."""
    samples: list[Sample] = []
    tap = open_tap(options, samples.append, lambda: False)
    assert tap is not None
    return samples, tap


def opened(endpoint: str, links: tuple[str, ...], keys: Path | None, system: str, linked: bool) -> zenoh.Session:
    """A router; with keys it has its rights beside them, for one system or all."""
    if keys is None:
        return open_router(endpoint, links=links)
    folder = keys / system if linked else keys
    return open_router(endpoint, router_tls(folder, joins=linked), rights_of(folder, *SYSTEMS).access_control, links)


def heard(pair: Pair, name: str, words: str) -> bool:
    """Whether these words came to an agent."""
    return any(words in str(item) for item in pair.listen(name))


def test_nothing_of_one_robot_reaches_an_agent_of_another(site: Site) -> None:
    """No communicate, receipt, ping, pong, token, heartbeat or telemetry, though the agents have the same names: each
    hears its own system only, and all of that.
    """
    first, second = site.first, site.second
    for pair in (first, second):
        pair.talk(pair.system)
        for name in ("co", "ta"):
            pair.fence(name, b"last of " + pair.system.encode())
    for pair in (first, second):
        for name in ("co", "ta"):
            wait_for(lambda p=pair, n=name: heard(p, n, f"last of {p.system}"), f"{name} of {pair.system} heard")
            wait_for(lambda p=pair, n=name: len(tokens(p, n)) == 1, f"{name} of {pair.system} sees its peer")
    for pair, other in ((first, second), (second, first)):
        for name in ("co", "ta"):
            assert not heard(pair, name, other.system), pair.heard[name]
            incarnation = 1 if pair.system == "velma1" else 2
            assert {token.incarnation for token in tokens(pair, name)} == {incarnation}
            mine = [item for item in pair.heard[name] if pair.system in str(item) and "last of" not in str(item)]
            assert len(mine) == SAID - len(KINDS) - PINGS, mine


def tokens(pair: Pair, name: str) -> list[Token]:
    """Return the tokens that an agent was told of."""
    return [item for item in pair.listen(name) if isinstance(item, Token) and item.alive]


def test_one_recorder_hears_all_of_both_robots(site: Site) -> None:
    """This holds wherever it is connected: everything said, and every token, each under its system's name."""
    first, second = site.first, site.second
    samples = site.samples
    wait_for(lambda: {one.system for one in samples if one.token} == set(SYSTEMS), "the tap sees who lives")
    for pair in (first, second):
        wait_for(lambda p=pair: _reaches(p, samples), f"the tap hears {pair.system}")
        before = len(samples)
        pair.talk("all of it")
        wait_for(
            lambda b=before: sum(b"all of it" in one.data for one in samples[b:]) == 2 * SAID, "all of it is heard"
        )
        assert {one.system for one in samples[before:]} == {pair.system}


def _reaches(pair: Pair, samples: list[Sample]) -> bool:
    """Say a word; whether any was heard. A subscription takes a moment to get from router to router."""
    pair.wires["co"].publish("state", b"reached")
    return any(one.system == pair.system and one.data == b"reached" for one in samples)


WHO = {"velma1.router": "router", "velma1.co": "co"}


@pytest.fixture
def home(tmp_path: Path) -> Iterator[tuple[str, list[Sample]]]:
    """velma2's router with keys of both robots; its address, and what a recorder hears there."""
    issuing.issue(tmp_path, DESIGN, SYSTEMS, linked=True)
    endpoint = free_endpoint().replace("tcp/", "tls/")
    router = opened(endpoint, (), tmp_path, "velma2", True)
    samples, tap = tapped(Options(connect=endpoint, systems=SYSTEMS, keys=tmp_path))
    yield endpoint, samples
    tap.close()
    router.close()


@pytest.mark.parametrize("name", WHO)
def test_who_is_of_one_robot_cannot_speak_for_another(
    tmp_path: Path, home: tuple[str, list[Sample]], name: str
) -> None:
    """At the other robot's router a neighbour's router may bring its own robot's words and tokens, and so may an agent,
    but none in the name of the robot that is at home there.
    """
    endpoint, samples = home
    with zenoh.open(client_config(endpoint, client_tls(tmp_path / "velma1", WHO[name]))) as stranger:
        kept = [stranger.liveliness().declare_token(f"roco/{system}/_/alive/co/7") for system in reversed(SYSTEMS)]
        for key in ("C1/co/ta/coordinate/request", "_/receipt/co/ta", "_/ping/co/ta", "_/state/co"):
            stranger.put(f"roco/velma2/{key}", b"a lie")
            stranger.put(f"roco/velma1/{key}", b"no lie")
        wait_for(lambda: sum(one.data == b"no lie" for one in samples) == 4, "its own words are heard")
        wait_for(lambda: any(one.token for one in samples), "its own token is seen")
        assert {one.system for one in samples} == {"velma1"}
        kept.clear()


# --- one monitor, two recordings, and a link that breaks ----------------------------------------------------------


@pytest.fixture
def broken(tmp_path: Path) -> Iterator[tuple[Pair, Pair, Cable]]:
    """Two robots with a router each, linked by a cable; a monitor process at the first one's."""
    near, far = free_endpoint(), free_endpoint()
    routers = [open_router(near)]
    cable = Cable(near)
    routers.append(open_router(far, links=(cable.endpoint,)))
    pairs = Pair("velma1", near), Pair("velma2", far)
    options = {
        "ROCO_CONNECT": near,
        "ROCO_RUN_DIR": str(tmp_path),
        "ROCO_SYSTEMS": ", ".join(SYSTEMS),
        "ROCO_VIEW": "off",
    }
    with (tmp_path / "monitor.log").open("ab") as log:
        command = [sys.executable, "-m", "services.monitor"]
        monitor = subprocess.Popen(command, env=os.environ | options, stdout=log, stderr=log)
    wait_for((tmp_path / "monitor.ready").exists, "the monitor taps")
    yield *pairs, cable
    cable.plug()
    monitor.send_signal(signal.SIGTERM)
    status = monitor.wait(120.0)  # two reports
    for one in (*pairs, *routers, cable):
        one.close()
    assert status == 0, (tmp_path / "monitor.log").read_text()
    for name in SYSTEMS:
        assert (tmp_path / name / "report.html").stat().st_size


def recorded(run: Path, name: str) -> tuple[Record, ...]:
    """Return the readable records of a system's recording."""
    return mcap_file.read(run / name / mcap_file.FILE).records


@pytest.mark.timeout(200)
def test_a_link_that_breaks_is_a_hole_in_the_recording_of_who_was_behind_it(
    tmp_path: Path, broken: tuple[Pair, Pair, Cable]
) -> None:
    """The robot behind it goes on; what it said meanwhile is not heard, and its recording says since when and how long.
    Afterwards it is heard again. The other robot's recording has no hole.
    """
    first, second, cable = broken

    def say_until_heard(pair: Pair, word: str) -> None:
        def heard_it() -> bool:
            pair.talk(word)
            return any(isinstance(one, Spoken) and one.id == word for one in recorded(tmp_path, pair.system))

        wait_for(heard_it, f"{word} of {pair.system} is recorded")

    for pair in (first, second):
        say_until_heard(pair, "before")
    cable.pull()
    second.talk("unheard")
    wait_for(lambda: "no agent is in reach" in (tmp_path / "monitor.log").read_text(), "the silence is noticed")
    wait_for(lambda: heard(second, "ta", "unheard") and heard(second, "co", "unheard"), "the robot goes on")
    say_until_heard(first, "meanwhile")
    cable.plug()
    say_until_heard(second, "after")
    holes = {name: [one for one in recorded(tmp_path, name) if isinstance(one, Resumed)] for name in SYSTEMS}
    assert holes["velma1"] == []
    (hole,) = holes["velma2"]
    assert hole.received - hole.since > LEASE_MS / 1000 / 2
    records = recorded(tmp_path, "velma2")
    at = records.index(hole)  # in the order heard: a word has the router's time, a token the recorder's, some ms later
    said = [one for one in records if isinstance(one, Spoken)]
    assert {one.id for one in records[:at] if isinstance(one, Spoken)} == {"before"}
    assert all((one.received <= hole.since) is (one.id == "before") for one in said)
    assert not any(one.id == "unheard" for one in said)


def test_a_name_that_could_lead_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    """The monitor ends with status 2, which nobody tries again, and says what a name may be."""
    options = {"ROCO_RUN_DIR": str(tmp_path), "ROCO_SYSTEMS": "velma1,../velma2"}
    command = [sys.executable, "-m", "services.monitor"]
    done = subprocess.run(command, env=os.environ | options, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 2
    assert "letters, digits" in done.stdout + done.stderr
