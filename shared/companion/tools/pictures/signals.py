"""The robot in numbers: joint positions, torques, wrenches at the wrists, how late the loop is."""

from collections.abc import Sequence

import rerun as rr

from companion.telemetry import Lateness, RobotState, TrueState
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, scalars
from velma.names import ARM, BODY, TORSO

ARMS = ("right", "left")
WRENCH = ("force x", "force y", "force z", "torque x", "torque y", "torque z")
QUANTILES = ("p50", "p99", "p99.9", "max")


class Signals:
    """Draws numbers of telemetry and truth."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._named: set[str] = set()

    def take(self, happening: Happening) -> None:
        """Draw them."""
        match happening.what:
            case RobotState() as state:
                self._joints(happening.at, "position", state.body, state.sim_time_s)
                self._draw(happening.at, "signals/position/head", ("pan", "tilt"), state.head, state.sim_time_s)
                self._draw(happening.at, "loop/late", QUANTILES, _numbers(state.lateness_us), state.sim_time_s)
                self._draw(happening.at, "loop/computes", QUANTILES, _numbers(state.compute_us), state.sim_time_s)
                self._draw(happening.at, "loop/missed", ("missed cycles",), (state.missed,), state.sim_time_s)
            case TrueState() as truth:
                if len(truth.torque_Nm) == len(BODY):
                    self._joints(happening.at, "torque", truth.torque_Nm, truth.time_s)
                for side, wrench in truth.wrench.items():
                    self._draw(happening.at, f"signals/wrench/{side}", WRENCH, wrench, truth.time_s)

    def _joints(self, at: float, kind: str, body: Sequence[float], sim: float) -> None:
        """Torso and arms; `body` in the order of velma.names.BODY."""
        self._draw(at, f"signals/{kind}/torso", ("torso",), (body[TORSO],), sim)
        for side in ARMS:
            values = [body[column] for column in ARM[side]]
            self._draw(at, f"signals/{kind}/{side}", tuple(f"{side} {k}" for k in range(len(values))), values, sim)

    def _draw(self, at: float, entity: str, names: Sequence[str], values: Sequence[float], sim: float) -> None:
        if entity not in self._named:
            self._named.add(entity)
            self._sheet.static(entity, rr.SeriesLines(names=list(names), widths=[1.2] * len(names)))
        self._sheet.add(entity, scalars, at, tuple(values), sim)


def _numbers(one: Lateness) -> tuple[float, ...]:
    return one.p50, one.p99, one.p999, one.max
