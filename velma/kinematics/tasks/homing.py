"""Where an empty arm goes when it is not needed: its start posture, with the torso turned where it has room."""

from collections.abc import Iterator

import numpy as np

from velma import names

TORSO = (0.0, -0.3, 0.3, -0.6, 0.6, -0.9, 0.9)  # [rad], tried in this order; task runs with the true robot model
FINGERS = 1.0  # [rad], same runs


def homes(q: np.ndarray, side: str) -> Iterator[np.ndarray]:
    """Yield postures (15,) with the arm as at the start, the torso as in q (15,) or turned."""
    for torso in (float(q[names.TORSO]), *TORSO):
        goal = q.copy()
        goal[names.ARM[side]] = names.START[names.ARM[side]]
        goal[names.TORSO] = torso
        yield goal
