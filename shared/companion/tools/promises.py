"""Promises of this robot, judged over the whole history of a run (operate.judging.invariants),
beside success.
"""

from collections import Counter
from collections.abc import Iterator

from companion.languages import rc
from companion.tools.report.verdict import MOST_TILT_DEG
from companion.tools.telemetry import robot, truth
from operate.recording.history import History

MODES = ("", "motion", "damping", "hold", "stopped")
"""Of the control loop; "" before it has told one. A test compares them with
services.executor.loop.
"""


def broken(history: History) -> Iterator[str]:
    """Yield what is broken: an act that was begun twice, a mode that is not one, a vessel that
    fell.
    """
    yield from (
        f"the act {key} was begun {times} times" for key, times in begun_twice(history).items()
    )
    yield from (
        f"the control loop was in mode {mode!r}"
        for mode in {one.mode for _, one in robot(history)} - {*MODES}
    )
    for _, last in truth(history)[-1:]:
        for name, tilt in last.tilt_deg.items():
            if tilt >= MOST_TILT_DEG and not sum(last.fingers_on.get(name, {}).values()):
                yield f"{name} has fallen: it is tilted by {tilt:.0f} degrees, and in no hand"


def begun_twice(history: History) -> dict[str, int]:
    """The acts that ex agreed to begin more than once, with how often."""
    keys = Counter(one.content.key for one in history.said if isinstance(one.content, rc.Accepted))
    return {key: times for key, times in keys.items() if times > 1}
