"""Several robots at one router: nothing of one reaches an agent of another, and the router's
listener hears both.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import product
from pathlib import Path

import msgspec
import pytest
import zenoh
from neighbours import KINDS, Cable, Pair
from toy_fleet import service, serving, wait_for

from agent_runtime.io import issuing
from agent_runtime.io.secured import client_tls, rights_of, router_tls
from agent_runtime.io.sessions import client_config, free_endpoint, open_router
from agent_runtime.io.tap import RECORDER, Sample
from agent_runtime.io.zenoh_wire import Token
from companion.design import DESIGN
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Record, Spoken, Unpaired

pytestmark = pytest.mark.zenoh
SYSTEMS = ("velma1", "velma2")
SAID = len(("communicate", "receipt", "ping", "pong", *KINDS))
"""One of everything that `Pair.talk` says, each way."""
PINGS = len(("ping", "pong"))
"""No agent takes them here: what they say is not a channel."""


class Site(msgspec.Struct):
    """Two pairs, and what a recorder hears."""

    first: Pair
    second: Pair
    samples: list[Sample]


@pytest.fixture(params=["open to all", "rights"])
def site(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Site]:
    """Both robots at one router."""
    keys = tmp_path if request.param == "rights" else None
    with router_at(keys) as (endpoint, samples):
        pairs = Pair("velma1", endpoint, keys), Pair("velma2", endpoint, keys)
        yield Site(*pairs, samples)
        for one in pairs:
            one.close()


@contextmanager
def router_at(keys: Path | None) -> Iterator[tuple[str, list[Sample]]]:
    """A router, with keys of both robots or without; its address, and what is heard there."""
    endpoint, access = free_endpoint(), None
    if keys:
        issuing.issue(keys, DESIGN, SYSTEMS)
        endpoint = endpoint.replace("tcp/", "tls/")
        access = rights_of(keys, *SYSTEMS).access_control
    router = open_router(endpoint, keys and router_tls(keys), access)
    ear = Ear(endpoint, keys)
    yield endpoint, ear.samples
    for one in (ear, router):
        one.close()


class Ear:
    """Whoever has the monitor's keys: it hears everything of both systems that goes by the
    router.
    """

    def __init__(self, endpoint: str, keys: Path | None) -> None:
        samples = self.samples = list[Sample]()

        def heard(sample: zenoh.Sample) -> None:
            samples.append(Sample(str(sample.key_expr), sample.payload.to_bytes(), 0.0))

        def lived(sample: zenoh.Sample) -> None:
            samples.append(Sample(str(sample.key_expr), b"", 0.0, token=True))

        self._session = zenoh.open(client_config(endpoint, keys and client_tls(keys, RECORDER)))
        self._declared: list[object] = []
        tokens = self._session.liveliness()
        for system in SYSTEMS:
            alive = f"roco/{system}/_/alive/*/*"
            self._declared += [
                self._session.declare_subscriber(f"roco/{system}/**", heard),
                tokens.declare_subscriber(alive, lived, history=True),
            ]

    def close(self) -> None:
        """Hear no more."""
        self._session.close()  # type: ignore[no-untyped-call]


def heard(pair: Pair, name: str, words: str) -> bool:
    """Whether these words came to an agent."""
    return any(words in str(item) for item in pair.listen(name))


def test_nothing_of_one_robot_reaches_an_agent_of_another(site: Site) -> None:
    """No communicate, receipt, ping, pong, token, heartbeat or telemetry, though the agents have
    the same names: each hears its own system only, and all of that.
    """
    pairs, names = (site.first, site.second), ("co", "ta")
    for pair in pairs:
        pair.talk(pair.system)
        for name in names:
            pair.fence(name, b"last of " + pair.system.encode())
    for pair, name in product(pairs, names):
        wait_for(partial(heard, pair, name, f"last of {pair.system}"), f"{name} heard")
        wait_for(partial(tokens, pair, name), f"{name} of {pair.system} sees its peer")
    for pair, other in (pairs, pairs[::-1]):
        for name in names:
            assert not heard(pair, name, other.system), pair.heard[name]
            (token,) = tokens(pair, name)
            assert token.incarnation == (1 if pair.system == "velma1" else 2)
            texts = [text for text in map(str, pair.heard[name]) if "last of" not in text]
            mine = [text for text in texts if pair.system in text]
            assert len(mine) == SAID - len(KINDS) - PINGS, mine


def tokens(pair: Pair, name: str) -> list[Token]:
    """Return the tokens that an agent was told of."""
    return [item for item in pair.listen(name) if isinstance(item, Token) and item.alive]


def test_one_recorder_hears_both_robots(site: Site) -> None:
    """What is for tools, and every token, each under its system's name; what agents say to each
    other is not heard.
    """
    samples = site.samples
    lives = lambda: {one.system for one in samples if one.token}  # noqa: E731
    wait_for(lambda: lives() == set(SYSTEMS), "the tap sees who lives")
    for pair in (site.first, site.second):
        wait_for(partial(_reaches, pair, samples), f"the tap hears {pair.system}")
        before = len(samples)
        pair.talk("all of it")
        meant = [b"all of it"] * (2 * len(KINDS))
        said = lambda: [one.data for one in samples[before:]]  # noqa: E731, B023
        wait_for(lambda: [one for one in said() if one in meant] == meant, "it is heard")  # noqa: B023
        assert {one.system for one in samples[before:]} == {pair.system}
        assert {one.key.split("/")[3] for one in samples[before:]} == set(KINDS)


def _reaches(pair: Pair, samples: list[Sample]) -> bool:
    """Say a word; whether any was heard. A subscription takes a moment."""
    pair.wires["co"].publish("state", b"reached")
    return any(one.system == pair.system and one.data == b"reached" for one in samples)


@pytest.fixture
def home(tmp_path: Path) -> Iterator[tuple[str, list[Sample]]]:
    """A router with keys of both robots; its address, and what a recorder hears there."""
    with router_at(tmp_path) as opened:
        yield opened


def test_who_is_of_one_robot_cannot_speak_for_another(
    tmp_path: Path, home: tuple[str, list[Sample]]
) -> None:
    """At the router an agent brings what is its own robot's, and nothing in the name of the other
    one.
    """
    endpoint, samples = home
    with zenoh.open(client_config(endpoint, client_tls(tmp_path / "velma1", "co"))) as stranger:
        lives = [f"roco/{system}/_/alive/co/7" for system in reversed(SYSTEMS)]
        kept = [stranger.liveliness().declare_token(key) for key in lives]
        for key in ("_/steps/co", "_/state/co"):
            stranger.put(f"roco/velma2/{key}", b"a lie")
            stranger.put(f"roco/velma1/{key}", b"no lie")
        told = lambda: [one.data for one in samples]  # noqa: E731
        wait_for(lambda: told().count(b"no lie") == 2, "what is its own is heard")
        wait_for(lambda: any(one.token for one in samples), "its own token is seen")
        assert {one.system for one in samples} == {"velma1"}
        kept.clear()


def test_an_agent_does_not_speak_to_one_of_another_robot(
    tmp_path: Path, home: tuple[str, list[Sample]]
) -> None:
    """co of one robot dials ta of the other: ta hears nothing of it under either robot's name, and
    hears its own co.
    """
    pair = Pair("velma2", home[0], tmp_path)
    tls, kept = client_tls(tmp_path / "velma1", "co"), []
    with zenoh.open(client_config(pair.ends["ta"], tls)) as stranger:
        for system in SYSTEMS:
            kept.append(stranger.liveliness().declare_token(f"roco/{system}/_/alive/co/7"))
            for key in ("C1/co/ta/coordinate/request", "_/receipt/co/ta", "_/ping/co/ta"):
                stranger.put(f"roco/{system}/{key}", b"C1 a lie")
        pair.fence("ta", b"no lie")
        wait_for(lambda: heard(pair, "ta", "no lie"), "its own co is heard")
        wait_for(lambda: len(tokens(pair, "ta")) == 1, "its own co is seen")
        assert not heard(pair, "ta", "a lie")
        assert {token.incarnation for token in tokens(pair, "ta")} == {2}
        kept.clear()
    pair.close()


# --- one monitor, two recordings, and a link that breaks ------------------------------------------


@pytest.fixture
def broken(tmp_path: Path) -> Iterator[tuple[Pair, Pair, Cable]]:
    """Two robots, whose agents are linked; the second one reaches router and monitor by a cable."""
    near = free_endpoint()
    router, cable = open_router(near), Cable(near)
    pairs = (
        Pair("velma1", near, logs=tmp_path / "one"),
        Pair("velma2", cable.endpoint, logs=tmp_path / "two"),
    )
    told = {"CONNECT": near, "SYSTEMS": ", ".join(SYSTEMS), "VIEW": "off"}
    with serving("monitor", tmp_path, 120.0, **told):  # it makes two reports at its end
        yield *pairs, cable
        cable.plug()
    for one in (*pairs, router, cable):
        one.close()
    for name in SYSTEMS:
        assert (tmp_path / name / "report.html").stat().st_size


def recorded(run: Path, name: str) -> tuple[Record, ...]:
    """Return the readable records of a system's recording."""
    return mcap_file.read(run / name / TRAFFIC_FILE).records


@pytest.mark.timeout(200)
def test_what_was_said_behind_a_link_that_broke_is_recorded(
    tmp_path: Path, broken: tuple[Pair, Pair, Cable]
) -> None:
    """The robot behind it goes on, and its agents' logs tell the rest as soon as the link is
    back.
    """
    first, second, cable = broken

    def said(pair: Pair) -> set[str]:
        return {one.id for one in recorded(tmp_path, pair.system) if isinstance(one, Spoken)}

    def recorded_are(pair: Pair, *texts: str) -> None:
        wait_for(lambda: said(pair) == {*texts}, f"{texts} of {pair.system} are recorded", 60.0)

    for pair in (first, second):
        pair.talk("before")
        recorded_are(pair, "before")
    cable.pull()
    second.talk("unheard")
    first.talk("meanwhile")
    for name in ("co", "ta"):
        wait_for(partial(heard, second, name, "unheard"), "the robot goes on")
    recorded_are(first, "before", "meanwhile")
    assert said(second) == {"before"}
    cable.plug()
    second.talk("after")
    recorded_are(second, "before", "unheard", "after")
    found = [one for one in recorded(tmp_path, second.system) if isinstance(one, Spoken | Unpaired)]
    assert len(found) == 2 * 3, "each once, both ways, and nothing that two logs differ in"


def test_a_name_that_could_lead_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    """The monitor ends with status 2, which nobody tries again, and says what a name may be."""
    log = tmp_path / "log"
    done = service("monitor", log, RUN_DIR=tmp_path, SYSTEMS="velma1,../velma2")
    assert done.wait(50.0) == 2
    assert "letters, digits" in log.read_text()
