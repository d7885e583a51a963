"""A jar that clogs in its first tilt is tilted again, and farther: true loop, simulated physics."""

import mujoco
import pytest
from tilts import BOWL, JAR, brought

from velma.sim.truth import TruthReader

GRAIN_KG = 0.002  # velma/model/objects.yaml
CLOGGED, UPRIGHT_DEG = 20, 80.0
CLOG_M = 0.17  # near the opening


class Clog:
    """The jar's bottom rises as soon as `CLOGGED` grains are left in it, and sinks when it is
    upright again, once.

    Tilted by more than a right angle, a jar needs no bottom: there it is a lump behind which the
    rest stays.
    """

    def __init__(self, core):
        self._model, self._cycle = core.backend.model, core.cycle
        self._truth = TruthReader(core.backend)
        # its boxes are those of the first place
        self._model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        self._bottom = self._model.geom(f"{JAR}_bottom").id
        self._below = float(self._model.geom_pos[self._bottom, 2])
        self._clogged = False
        self.left = None
        core.cycle = self  # type: ignore[assignment]

    def __call__(self):
        """Run a cycle."""
        self._cycle()
        if self.left is not None:
            return
        now = self._truth.read()
        if not self._clogged and now.grains_in[JAR] <= CLOGGED:
            self._clogged = True
            self._model.geom_pos[self._bottom, 2] = self._below + CLOG_M
        elif self._clogged and now.tilt_deg[JAR] < UPRIGHT_DEG:
            self.left = now.grains_in[JAR]
            self._model.geom_pos[self._bottom, 2] = self._below


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_jar_that_clogs_is_tilted_again(jar_out):
    """Much was left after the first tilt; at the end the content is in the bowl, and the hand felt
    how much left.
    """
    acting, pour = jar_out, brought(jar_out)
    clog, before = Clog(acting.core), acting.truth.grains_in[JAR]
    outcome = acting.done(pour)
    assert clog.left is not None
    assert clog.left >= before / 3, "the first tilt left content"
    truth = acting.truth
    assert outcome.weighed is not None
    full, rest = outcome.weighed
    assert full - rest == pytest.approx(GRAIN_KG * (before - truth.grains_in[JAR]), abs=0.005)
    assert truth.grains_in[BOWL] >= 0.9 * before
