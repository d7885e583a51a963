"""The depot in containers: brought up by its own compose.yaml, then asked by the verbs that look
into containers.

A part of scripts/compose-test. What a verb must tell is in the table below; nothing of the robot
may be in it.
"""

import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from containers import ROOT, Docker, Failed, wait

DEPOT = ROOT / "examples" / "depot"
AGENTS = ("desk", "dispatcher", "traffic", "mule", "ox")
CHANNELS = ("C2", "C4", "C5", "C6", "C7")
# estimates: several times what a loaded 2-core machine needs
UP_S, VERB_S, DELIVERED_S = 120.0, 60.0, 90.0
FOREIGN = re.compile(r"\b(hi|co|pl|km|ta|ex|loop|velma|jar|bowl)\b", re.IGNORECASE)
ASKED: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("status", ("router", "monitor", *AGENTS, "ready")),
    ("agents", ("router", "monitor", *AGENTS, "MiB")),
    ("top --graph --once", (*AGENTS, *CHANNELS)),
    ("top --once", (*AGENTS, *CHANNELS)),
    ("conversation --channel C2", ("desk > dispatcher", "request")),
    ("conversation desk-1-1", ("desk-1-1  ", " on C2  ")),
    ("agents ox", ("dispatcher on C5", "traffic on C7")),
    ("agents --offers --up", (*AGENTS, "cfp")),
    ("logs -n 20", ("dispatcher", "performative=")),
    ("param", ("dispatcher", "rounds")),
    ("param dispatcher rounds 30", ("30",)),
    ("param dispatcher rounds", ("30",)),
    ("agent pause mule", ("mule: paused",)),
    ("agent start mule", ("mule: goes on",)),
    ("param mule log-level debug", ("debug",)),
    ("agent restart ox", ("ox: ready",)),
    ("agent stop traffic", ("traffic: stopped",)),
    ("agent start traffic", ("traffic: ready",)),
    ("fault kill ox", ("kill ox: begun", "back")),
    ("fault pause mule --for 1", ("healed after 1 s",)),
    ("fault hang traffic --for 2", ("healed after 2 s",)),
    ("fault restart desk", ("restart desk: begun", "back")),
    ("fault list", ("kill ox", "pause mule", "hang traffic", "restart desk")),
    ("doctor", ("7 processes of compose project", "all ready")),
)
"""Words of a verb, and what it tells."""
HEARS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("traffic echo --count 2", ("desk", "dispatcher", "C2")),
    ("traffic stats hz --for 6", ("C2",)),
    ("traffic stats bw --for 6", ("C2",)),
    ("traffic stats size --for 6", ("C2",)),
    ("traffic stats --for 6", ("C2",)),
    ("sniff --count 2", ("desk", "dispatcher", "C2")),
    ("record --for 6 --out part.mcap", ("communicates", "part.mcap")),
)
"""The same of those that listen; a restarted desk has something to say."""


def check(docker: Docker, say: Callable[[str], None]) -> None:
    """Bring the depot up beside whatever else runs, ask every verb of the table, bring it down.
    Raise Failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "depot"
        shutil.copytree(DEPOT, place, ignore=shutil.ignore_patterns("runs", "__pycache__"))
        place.parent.chmod(0o755)  # the containers' user reads it
        fleet = docker.elsewhere(f"{docker.project}-depot", place / "compose.yaml")
        began = time.monotonic()
        try:
            fleet.compose("up", "-d", within_s=UP_S)
            _delivered(fleet)
            say(
                "depot: up, and the first order is delivered after"
                f" {time.monotonic() - began:.1f} s"
            )
            for words, has in ASKED:
                _ask(place, fleet.project, words, has)
            for words, has in HEARS:
                _hear(place, fleet, words, has)
            _ask(place, fleet.project, "down", ("ended",))
            count = len(ASKED) + len(HEARS) + 1
            say(f"depot: {count} verbs tell of its containers, in {time.monotonic() - began:.1f} s")
        finally:
            fleet.compose("down", "-v", "-t", "10", within_s=UP_S)


def _delivered(fleet: Docker) -> None:
    look = ("monitor", "grep", "-c", "delivered", "/var/lib/roco/run/verdicts.jsonl")
    wait("no order is delivered", DELIVERED_S, lambda: int(fleet.execute(*look)) > 0)


def _ask(place: Path, project: str, words: str, has: tuple[str, ...]) -> None:
    """Call a verb in the project's folder, as a person does; wide enough that nothing is cut."""
    process = _begun(place, project, words)
    try:
        said, _ = process.communicate(timeout=VERB_S)
    except subprocess.TimeoutExpired:
        process.kill()
        raise Failed(f"roco {words}: not done within {VERB_S:.0f} s") from None
    _told(words, process.returncode, said, has)


def _hear(place: Path, fleet: Docker, words: str, has: tuple[str, ...]) -> None:
    """Have a verb listen, and restart an agent until it has heard enough."""
    process, end = _begun(place, fleet.project, words), time.monotonic() + VERB_S
    while process.poll() is None:
        if time.monotonic() > end:
            process.kill()
            raise Failed(f"roco {words}: heard nothing within {VERB_S:.0f} s")
        fleet.compose("restart", "-t", "10", "desk", within_s=UP_S)
    _told(words, process.returncode, process.communicate()[0], has)


def _begun(place: Path, project: str, words: str) -> "subprocess.Popen[str]":
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
    return subprocess.Popen(
        [
            str(ROOT / ".venv/bin/python"),
            "-P",
            "-m",
            "console",
            *words.split(),
            "--target",
            project,
        ],
        cwd=place,
        env=kept | {"COLUMNS": "200"},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def _told(words: str, code: int, said: str, has: tuple[str, ...]) -> None:
    missing = [text for text in has if text not in said]
    foreign = FOREIGN.findall(said)
    if code or missing or foreign:
        raise Failed(
            f"roco {words}: exit code {code}, lacks {missing}, has {foreign} of the robot:\n{said}"
        )
