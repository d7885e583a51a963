"""The same with a mistake that is easily made: one joint's drive counts the other way. The kit
names it.
"""

from point_mass import PointMasses

from velma.sim.backend import Command


class Turned(PointMasses):
    """The second joint of the right arm turns against its torque."""

    def step(self, command: Command) -> None:
        """Sent with the wrong sign."""
        command.tau[2] *= -1.0
        super().step(command)
        command.tau[2] *= -1.0


def make() -> Turned:
    """A robot at rest."""
    return Turned()
