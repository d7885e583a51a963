"""The communicates of a run folder as plain observations, to compare them with a design (roco design)."""

import sys
from pathlib import Path

import msgspec

from operate.recording import history
from operate.recording.records import Spoken
from operate.system import of_run
from topdown.check.recorded import Observation, Observed


def observed(run: Path) -> Observed:
    """Everything said in a run, each once, and the names of its events; of a folder without a recording nothing."""
    system = of_run(run)
    found, events = history.load(run, system), system.addition("events")
    return Observed(
        communicates=tuple(_observation(one) for one in found.said),
        events=tuple(event.name for event in events(found)) if events is not None else (),
    )


def _observation(one: Spoken) -> Observation:
    content = one.content
    return Observation(
        at=one.received,
        sender=one.sender,
        receiver=one.receiver,
        protocol=one.protocol,
        performative=one.communicate.performative,
        bytes=one.size,
        conversation=one.conversation,
        content=f"{one.language}.{type(content).__name__}" if content is not None else "",
    )


def main(run: Path) -> None:
    """Print the observations of a run folder as one JSON object."""
    sys.stdout.buffer.write(msgspec.json.encode(observed(run)) + b"\n")
