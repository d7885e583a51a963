"""There is no way around the router: every session is its client alone, listens nowhere and looks
for nobody.

Except the links of an agent, which listens at its own address, dials its neighbours alone and looks
for nobody either.
"""

import ast
import json
import os
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from guarded import SYSTEM, Guarded

from agent_runtime import impersonation
from agent_runtime.io import sessions, tap
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import client_config, close, links_config, open_client, router_config

pytestmark = pytest.mark.zenoh
ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    path
    for room in ("services", "shared", "velma", "examples", "benchmarks", "scripts", "tests")
    for path in sorted((ROOT / room).rglob("*"))
    if path.suffix == ".py" or room == "scripts"
    if path.is_file() and b"zenoh" in path.read_bytes() and path != Path(__file__).resolve()
]
MAKERS = {"client_config", "links_config", "router_config"}


def test_every_session_is_opened_with_our_configuration_and_whatever_is_put_is_not_too_long() -> (
    None
):
    """zenoh.open gets what a function of sessions.py made, and nobody else makes a configuration.

    In the product `put` of sessions.py looks at the size, and nobody else puts on a session; a
    publisher is declared, but never puts.
    """
    wrong = []
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        if path.suffix != ".py" and not text.startswith("#!/usr/bin/env python"):
            continue
        calls = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call))
        for node in (one for one in calls if ast.unparse(one.func) == "zenoh.open"):
            (given,) = node.args
            if (
                not isinstance(given, ast.Call)
                or ast.unparse(given.func).split(".")[-1] not in MAKERS
            ):
                wrong.append(f"{path}, line {node.lineno}: {ast.unparse(node)}")
        if path.name == "sessions.py":
            continue
        putting = any(path.is_relative_to(ROOT / room) for room in ("shared", "services"))
        puts = r"|(session|publisher|opened|declare_\w+\(.*\))\.put\(|put_with" if putting else ""
        found = re.search(
            rf"Config\.from_|Config\(\)|insert_json5|^from zenoh import{puts}", text, re.MULTILINE
        )
        wrong += [f"{path}: {found[0]}"] if found else []
    assert not wrong


@pytest.mark.parametrize("tls", [None, {"enable_mtls": True}], ids=["plain", "tls"])
def test_a_client_listens_nowhere_and_looks_for_nobody(tls: dict[str, bool] | None) -> None:
    """One endpoint to call, none to be called at, neither multicast nor gossip; the router looks
    for nobody, either.
    """
    address = "tls/127.0.0.1:7447" if tls else "tcp/127.0.0.1:7447"
    client, router = client_config(address, tls), router_config(address, tls)
    assert json.loads(client.get_json("mode")) == "client"
    assert json.loads(client.get_json("connect/endpoints")) == [address]
    assert not endpoints(client, "listen")
    assert json.loads(router.get_json("mode")) == "router"
    assert endpoints(router, "listen") == [address]
    assert not endpoints(router, "connect")
    links = links_config(address, ("tcp/a:1", "tcp/b:2"), tls)
    assert json.loads(links.get_json("mode")) == "peer"
    assert endpoints(links, "listen") == [address]
    assert endpoints(links, "connect") == ["tcp/a:1", "tcp/b:2"]
    for config in (client, router, links):
        for way in ("multicast", "gossip"):
            assert json.loads(config.get_json(f"scouting/{way}/enabled")) is False


def endpoints(config: zenoh.Config, way: str) -> list[str]:
    """Of a configuration for its own mode: Zenoh has defaults for each."""
    found = json.loads(config.get_json(f"{way}/endpoints"))
    return found.get(json.loads(config.get_json("mode")), []) if isinstance(found, dict) else found


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    """A router with keys in this process, and nothing else that listens."""
    one = Guarded(tmp_path_factory.mktemp("keys"))
    yield one
    one.close()


def sockets() -> set[str]:
    """Return the inodes of this process's listening TCP sockets, and of all its UDP sockets."""
    files = [Path("/proc/self/fd", fd) for fd in os.listdir("/proc/self/fd")]
    links = [os.readlink(file) for file in files if file.is_symlink()]
    mine = {link[8:-1] for link in links if link.startswith("socket:[")}
    found = set()
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[9] in mine and (table.startswith("udp") or fields[3] == "0A"):
                found.add(fields[9])
    return found


def test_whoever_opens_a_session_is_a_client(
    guarded: Guarded, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tool's session, the recorder's tap, the voice of `roco send`: real sessions with keys, and
    no new socket.
    """
    configs: list[zenoh.Config] = []
    really = zenoh.open
    monkeypatch.setattr(
        sessions.zenoh, "open", lambda config: configs.append(config) or really(config)
    )
    before, tls = sockets(), {name: client_tls(guarded.folder, name) for name in ("co", "hi")}
    session = open_client(guarded.endpoint, lambda: False, tls=tls["co"])
    options = Options(connect=guarded.endpoint, system=SYSTEM, keys=guarded.folder)
    opened = [
        session,
        tap.open_tap(options, lambda _: None, lambda: False),
        impersonation.Voice(guarded.endpoint, (), tls=tls["hi"]),
    ]
    assert len(configs) == len(opened)
    assert sockets() == before
    for config in configs:
        assert json.loads(config.get_json("mode")) == "client"
        assert json.loads(config.get_json("connect/endpoints")) == [guarded.endpoint]
    for one in opened:
        one.close()


class Stuck:
    """A session that does not close before it is let go."""

    def __init__(self) -> None:
        self.let_go = threading.Event()

    def close(self) -> None:
        """As Zenoh's, without a limit."""
        self.let_go.wait()


def test_a_session_that_does_not_close_holds_nobody_up(capfd: pytest.CaptureFixture[str]) -> None:
    """It is left, and that is said."""
    stuck = Stuck()
    try:
        assert not close(stuck, 0.05)  # type: ignore[arg-type]
        assert "the Zenoh session has not closed within 0.05 s" in capfd.readouterr().err
    finally:
        stuck.let_go.set()
    assert close(stuck)  # type: ignore[arg-type]
