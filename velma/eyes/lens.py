"""The head camera's lens: a pinhole without distortion. Pixels are counted from the centre of the
first one.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Simulated Kinect of Velma (velma_robot@43752e0), as in velma/model/robot.yaml: 1.047 rad across,
# 800 x 600.
WIDTH, HEIGHT = 800, 600
HALF_WIDTH = math.tan(1.047 / 2)
HALF_HEIGHT = HALF_WIDTH * HEIGHT / WIDTH
"""Half of the picture at a distance of 1, without a unit."""


class Lens(NamedTuple):
    """Focal length and principal point [pixels]."""

    focal: float
    centre_x: float
    centre_y: float

    def matrix(self) -> Array:
        """Return the camera matrix (3, 3)."""
        return np.array(
            [[self.focal, 0.0, self.centre_x], [0.0, self.focal, self.centre_y], [0.0, 0.0, 1.0]]
        )

    def project(self, points: Array) -> Array:
        """Return pixels (n, 2) of points (n, 3) in the optical frame: x right, y down, z forward, z
        not 0.
        """
        return np.asarray(
            self.focal * points[:, :2] / points[:, 2:] + np.array([self.centre_x, self.centre_y])
        )


LENS = Lens(WIDTH / 2 / HALF_WIDTH, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
"""That of the pictures of WIDTH x HEIGHT pixels."""
