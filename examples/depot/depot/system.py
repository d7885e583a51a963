"""The system as the tools see it (operate.system): `roco` in this folder is about it."""

from operate.system import System, agents, around

from depot.design import DESIGN, LANGUAGES

AGENTS = ("desk", "dispatcher", "traffic", "mule", "ox")

SYSTEM = System(
    name="depot",
    design=DESIGN,
    languages=LANGUAGES,
    processes=(*around(), *agents("depot", *AGENTS)),
)
