"""Whether a real robot stands behind the executor: then `roco fault` leaves the fleet alone."""

from operate.cli.fleet.targets import Target

LOOP, BACKEND = "loop", "ROCO_BACKEND"
HARMLESS = ("", "mujoco", "mock")
"""Back-ends that move nothing; "" is mujoco (services.executor.loop)."""


def untouchable(fleet: Target) -> str:
    """Return why no fault may be done to this fleet; "" where its robot is a simulated one."""
    backend = fleet.variable(LOOP, BACKEND)
    return "" if backend in HARMLESS else f"the back-end {backend} may move a real robot"
