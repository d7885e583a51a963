"""Parts of the verdict on a pour; that of whole runs is tested with the report
(tests/companion/tools).
"""

import math

import pytest

from companion.languages.values import Pose
from companion.tasks.pour import verdict

pytestmark = pytest.mark.timeout(60)


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2, -2.0])
def test_a_point_on_a_turned_table_is_on_it(yaw):
    """A corner of the top belongs to it, whichever way the table is turned; a point outside does
    not.
    """
    table = Pose((1.0, 2.0, 0.0), (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))
    for reach, inside in ((0.45, True), (0.47, False)):
        x = 1.0 + reach * math.cos(yaw) - reach * math.sin(yaw)
        y = 2.0 + reach * math.sin(yaw) + reach * math.cos(yaw)
        assert verdict._stands_on(x, y, 0.775, "table", table) is inside
        assert not verdict._stands_on(x, y, 0.9, "table", table)
