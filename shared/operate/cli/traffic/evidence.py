"""Evidence from a recording about the agents of its run, for comparison with their output when they are run again.

Of each communicate a digest is kept; the bytes are read a second time where a difference asks for them.
"""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import msgspec

from agent_runtime.core.effects import Receipt
from agent_runtime.io.step_replay import digest
from agent_runtime.io.tap import Sample
from fipa_codec.communicate import UNREADABLE, Communicate
from operate.cli.traffic.listen import HOUSE, recorded, said

SETTING, RECEIPT = "setting", "receipt"
"""Kinds of signals: what the fleet was started with, and what an agent has received."""
NEAR_S = 2.0
"""Time after a step within which its receipts are heard [s]; estimate: it takes milliseconds."""


class Setting(msgspec.Struct, frozen=True):
    """Options with which the fleet was started."""

    seed: int = 1
    speed: str = "1"
    scene: str = ""


class Evidence:
    """`setting`: of the fleet; `words`: agent -> (receiver, id) -> digests of all that went by under it.

    Without a file there is nothing, and `there` is False.
    """

    def __init__(self, file: Path | None) -> None:
        self._file, self.setting = file, Setting()
        self.words: dict[str, dict[tuple[str, str], set[bytes]]] = defaultdict(lambda: defaultdict(set))
        for sample in self._samples():
            if kind_of(sample) == SETTING:
                self.setting = _setting(sample.data)
            one = _communicate(sample)
            if one is not None:
                self.words[one.sender][one.receiver, one.id].add(digest(sample.data))

    @property
    def there(self) -> bool:
        """Whether there is a recording."""
        return self._file is not None

    def said(self, agent: str) -> list[Communicate]:
        """Return what went by of an agent, in order, copies too."""
        return [one for one in map(_communicate, self._samples()) if one is not None and one.sender == agent]

    def receipts(self, agent: str, at: float) -> list[Receipt]:
        """Return its receipts that were heard about then, in order."""
        near = (sample for sample in self._samples() if abs(sample.at - at) < NEAR_S)
        mine = (one for one in near if kind_of(one) == RECEIPT and one.key.split("/")[-2] == agent)
        return [msgspec.msgpack.decode(one.data, type=Receipt) for one in mine]

    def _samples(self) -> Iterator[Sample]:
        if self._file is not None:
            yield from (sample for sample in recorded(self._file, everything=True) if sample is not None)


def kind_of(sample: Sample) -> str:
    """Return the kind of a signal; "" of others."""
    chunks = sample.key.split("/")
    return chunks[3] if not sample.token and len(chunks) > 3 and chunks[2] == HOUSE else ""


def _communicate(sample: Sample) -> Communicate | None:
    one = said(sample)
    return None if one is None else one.communicate()


def _setting(data: bytes) -> Setting:
    try:
        return msgspec.json.decode(data, type=Setting)
    except UNREADABLE:
        return Setting()
