"""Files a project has once: the design and its reader, the process that runs all agents, compose entries, README."""

from topdown.model.design import Design
from topdown.scaffold.naming import docstring, sentence, wrapped


def project_files(design: Design, design_text: str, package: str) -> dict[str, str]:
    """Path -> text."""
    return {
        f"{package}/design.toml": design_text,
        f"{package}/__init__.py": f"{docstring(_title(design))}\n",
        f"{package}/py.typed": "",
        f"{package}/design.py": _DESIGN.format(package=package),
        f"{package}/__main__.py": _MAIN.format(package=package),
        f"{package}/system.py": _system(design, package),
        "pyproject.toml": _PYPROJECT.format(package=package),
        "compose.yaml": _compose(design, package),
        "README.md": _readme(design, package),
        ".gitignore": "__pycache__/\nruns/\n",
    }


def _title(design: Design) -> str:
    return f"{design.file.system.name}: {design.file.system.text or 'a system designed top-down'}."


_DESIGN = '''"""The design, read once from design.toml; whatever follows from it is asked of here."""

from pathlib import Path

from fipa_codec import protocols
from topdown.model.design import Design, load
from topdown.model.interfaces import interfaces

from {package}.languages import LANGUAGES

__all__ = ["DESIGN", "INTERFACES", "LANGUAGES"]

DESIGN: Design = load(Path(__file__).with_name("design.toml"))
for _table in DESIGN.own_tables.values():
    protocols.register(_table)

INTERFACES = interfaces(DESIGN, LANGUAGES)
"""Queries of each use of a protocol, with Python's classes."""
'''

_PYPROJECT = """[project]
name = "{package}"
version = "0.1.0"
requires-python = ">=3.11"
dependencies = ["robot-companion"]

[tool.roco]
system = "{package}.system:SYSTEM"
design = "{package}/design.toml"

[tool.ruff]
line-length = 120

[tool.ruff.lint]
select = ["E", "W", "F", "I", "B", "UP", "SIM", "C4"]

[tool.pytest.ini_options]
testpaths = ["tests"]
pythonpath = ["."]
addopts = "--import-mode=importlib"
"""


_MAIN = '''"""Router, monitor and agents as processes: `python -m {package}`; Ctrl-C ends them in order."""

from operate.supervisor import project

if __name__ == "__main__":
    project.run("{package}.system:SYSTEM")
'''


def _system(design: Design, package: str) -> str:
    names = wrapped("AGENTS = (", [f'"{agent}"' for agent in design.agents], ")")
    return f'''"""The system as the tools see it (operate.system): `roco` in this folder is about it."""

from operate.supervisor.processes import agents, around
from operate.system import System

from {package}.design import DESIGN, LANGUAGES

{names}

SYSTEM = System(
    name="{package}",
    design=DESIGN,
    languages=LANGUAGES,
    processes=(*around(), *agents("{package}", *AGENTS)),
)
'''


def _compose(design: Design, package: str) -> str:
    services = "\n".join(_service(agent, f"{package}.{agent}") for agent in design.agents)
    places = ",".join(f"{agent}=tcp/{agent}:7448" for agent in design.agents)
    return f"""# One service for each agent of design.toml, the router for tools, and the monitor, which records.
# Agents are linked with each other.
# `docker compose up -d` (or docker-compose 1.29) here; then the verbs of `roco` look into these containers.
# No TLS: for a network of your own. The image has Python 3.11, robot-companion and its extra `monitor`; this folder is
# mounted at /app. `docker compose -f deploy/compose.yaml build monitor` in the clone makes the one named here.

x-common: &common
  image: ${{{package.upper()}_IMAGE:-robot-companion/monitor}}
  init: true
  entrypoint: [python, -m]
  working_dir: /app
  labels: {{robot-companion.system: {package}}}
  volumes: [".:/app:ro", "run:/var/lib/roco"]
  restart: unless-stopped

x-environment: &environment
  PYTHONPATH: /app
  ROCO_SYSTEM: {package}
  ROCO_CONNECT: tcp/router:7447
  ROCO_RUN_DIR: /var/lib/roco/run
  TZ: ${{TZ:-}}

x-agent: &agent
  <<: *common
  environment:
    <<: *environment
    ROCO_LISTEN: tcp/0.0.0.0:7448
    ROCO_AGENTS: {places}
  depends_on: [router, monitor]

services:
  router:
    <<: *common
    command: [operate.router]
    environment: {{<<: *environment, ROCO_LISTEN: "tcp/0.0.0.0:7447"}}

  monitor:
    <<: *common
    command: [operate.recording]
    environment: *environment
    depends_on: [router]
    stop_grace_period: 60s # it writes the report

{services}
volumes:
  run:
"""


def _service(agent: str, module: str) -> str:
    return f"  {agent}:\n    <<: *agent\n    command: [{module}]\n"


def _readme(design: Design, package: str) -> str:
    rows = "\n".join(
        f"| `{agent}` | {sentence(entry.text or design.decomposition.tasks.get(agent, ''), 'not said')} |"
        for agent, entry in design.agents.items()
    )
    told = {
        f"python -m {package}": "router and agents as processes; prints what they say; Ctrl-C ends them",
        "roco up": "the same in the background; roco status, traffic echo, graph, top, down are about it",
        "python -m pytest": "the design is consistent, every agent binds and answers, all meet over Zenoh",
        f"roco design check {package}/design.toml": "what is wrong with the design, and where",
        f"roco design verify {package}/design.toml": "whether it can go wrong, and how",
    }
    width = max(map(len, told))
    commands = "\n".join(f"{command:<{width}}  # {what}" for command, what in told.items())
    return f"""# {package}

{sentence(design.file.system.text, "A system designed top-down")} Made by `roco design new` from
[`{package}/design.toml`]({package}/design.toml); the design is what runs.

| agent | what it is for |
|---|---|
{rows}

```
{commands}
```

To fill in, marked `# to fill in`, until then an agent refuses what it is asked and stays in its state:

- `{package}/languages/*.py`: the fields of each sentence
- `{package}/<agent>/memory.py`: what it remembers, and the conditions that end its states and label its arcs
- `{package}/<agent>/behaviours.py`: what it does in each state

After a change of the design: `roco design new --from {package}/design.toml .` makes what is new. A file
that you changed is kept, and the names it still lacks are told.
"""
