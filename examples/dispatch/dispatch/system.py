"""The system as the tools see it (operate.system): `roco` in this folder is about it."""

from operate.system import Process, System, agents, around

from dispatch.design import DESIGN, LANGUAGES

SEARCH = ("services.planner.search",)
"""A bidder's child searches plans, as the planner's does."""

SYSTEM = System(
    name="dispatch",
    design=DESIGN,
    languages=LANGUAGES,
    processes=(
        *around(),
        *agents("dispatch", "di"),
        *(Process(name, f"dispatch.{name}", after=("router", "monitor"), workers=SEARCH) for name in ("b1", "b2")),
    ),
)
