"""round_trip.py with a stamp of the common clock at each place a question passes: where its time goes.

Started like it by fleets.py, for as_shipped.py --only stages; each process leaves its stamps in the run folder.
"""

import statistics
import sys
import time
from pathlib import Path
from typing import Any

import msgspec
import round_trip

from agent_runtime.io import shell, zenoh_wire

PATH = {
    "pl take": "",
    "pl put": "pl: step, encode",
    "pl sent": "pl: put",
    "km heard": "to km, until its callback runs",
    "km take": "km: from the callback's thread to the loop",
    "km put": "km: decode, step, encode",
    "km sent": "km: put",
    "pl heard": "to pl, until its callback runs",
    "pl take again": "pl: from the callback's thread to the loop",
    "pl told": "pl: decode, step, until its own side is told",
}
"""Places in the order a question passes them, with what lies before each."""


def stamped(owner: Any, name: str, before: str, after: str, stamps: list[tuple[str, int]]) -> None:
    """Have a method leave a stamp before and after it ran ("": none)."""
    method = getattr(owner, name)

    def stamping(*given: Any, **named: Any) -> Any:
        if before:
            stamps.append((before, time.perf_counter_ns()))
        found = method(*given, **named)
        if after:
            stamps.append((after, time.perf_counter_ns()))
        return found

    setattr(owner, name, stamping)


def stage_times(run: Path) -> list[tuple[str, float]]:
    """(What, median [us]) of each stage, and of the whole, from the stamps of both processes."""
    both = [
        (at, f"{who} {place}")
        for who in ("pl", "km")
        for place, at in msgspec.json.decode((run / f"{who}.stamps").read_bytes(), type=list[tuple[str, int]])
    ]
    wanted, found, trips = list(PATH), list[int](), []
    for at, place in sorted(both):
        if place == wanted[len(found)].removesuffix(" again"):
            found.append(at)
        elif place == wanted[0]:
            found = [at]
        if len(found) == len(wanted):
            trips.append(found)
            found = []
    stages = [(PATH[wanted[n]], [(one[n] - one[n - 1]) / 1000 for one in trips]) for n in range(1, len(wanted))]
    stages.append(("the whole", [(one[-1] - one[0]) / 1000 for one in trips]))
    return [(what, statistics.median(times)) for what, times in stages]


def main(name: str, address: str, run: Path, out: int) -> int:
    """As round_trip.main."""
    stamps: list[tuple[str, int]] = []
    stamped(zenoh_wire.ZenohWire, "_put", "put", "sent", stamps)
    stamped(zenoh_wire.ZenohWire, "_on_communicate", "heard", "", stamps)
    stamped(shell.Shell, "_take", "take", "", stamps)
    stamped(round_trip.Turns, "tell", "told", "", stamps)
    code = round_trip.main(name, address, run, out)
    (run / f"{name}.stamps").write_bytes(msgspec.json.encode(stamps))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], Path(sys.argv[3]), int(sys.argv[4])))
