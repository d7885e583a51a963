"""Where each thing was over a run: the true poses where the simulation told them, else what km was told.

A truth without orientations (vessels' origins only) gets the turn that was observed last, so a tilted jar is drawn as
it was seen, not as it is tilted now.
"""

from bisect import bisect_right

import msgspec

from companion.languages import wm
from companion.languages.values import Pose
from services.monitor.history import History

# Kinds of the simulated scene (velma.model.scene.Model) -> names of companion.models, where they differ.
KNOWN_AS = {"bowl": "bowl_high", "cabinet": "cabinet_no_door"}
At = tuple[float, float | None]
"""Unix time, and simulated time where it is known [s]."""


class Placed(msgspec.Struct, frozen=True):
    """A thing: its model (companion.models) and its poses in the order of time."""

    name: str
    model: str
    times: tuple[At, ...]
    poses: tuple[Pose, ...]

    @property
    def moves(self) -> bool:
        """Whether it ever stood elsewhere."""
        return len(set(self.poses)) > 1


def placed(history: History) -> tuple[Placed, ...]:
    """All things anything is known of."""
    seen: dict[str, list[tuple[float, wm.SeenObject]]] = {}
    for one in history.said:
        if isinstance(one.content, wm.SeenObject):
            seen.setdefault(one.content.object, []).append((one.received, one.content))
    models = {name: sights[-1][1].model for name, sights in seen.items()}
    for _, truth in history.truth[:1]:
        models |= {name: KNOWN_AS.get(kind, kind) for name, kind in truth.models.items()}
    return tuple(_placed(history, name, model, seen.get(name, [])) for name, model in sorted(models.items()))


def _placed(history: History, name: str, model: str, seen: list[tuple[float, wm.SeenObject]]) -> Placed:
    true = [(at, t.time_s, t.poses[name]) for at, t in history.truth if name in t.poses]
    if not true:
        origins = [(at, t.time_s, t.at[name]) for at, t in history.truth if name in t.at]
        true = [(at, sim, Pose(xyz, _turn(seen, at))) for at, sim, xyz in origins]
    if true:
        return Placed(name, model, tuple((at, sim) for at, sim, _ in true), tuple(pose for *_, pose in true))
    return Placed(name, model, tuple((at, None) for at, _ in seen), tuple(sight.pose for _, sight in seen))


def _turn(seen: list[tuple[float, wm.SeenObject]], at: float) -> tuple[float, float, float, float]:
    """The orientation observed last before a time; upright where there is none."""
    number = bisect_right([time for time, _ in seen], at)
    return seen[number - 1][1].pose.quat_wxyz if number else (1.0, 0.0, 0.0, 0.0)
