"""deploy/compose.faults.yaml: a wire for each agent, guarded as every service is, and nothing else
changed.
"""

from pathlib import Path

import yaml

from agent_runtime.io.cli import endpoints
from companion.design import DESIGN
from operate.fault_proxy import files

ROOT = Path(__file__).resolve().parents[2]
ONE = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())
OVER = yaml.safe_load((ROOT / "deploy/compose.faults.yaml").read_text())
WIRES = OVER["services"]["wires"]
OWN = {"command", "environment", "volumes", "depends_on", "healthcheck", "mem_limit"}


def test_each_agent_reaches_the_router_and_its_neighbours_by_wires_of_its_own():
    """The proxy listens for each where that one is told to connect, and goes on to where the other
    end listens.
    """
    own = WIRES["environment"]
    told = files.listed(own["ROCO_CONNECT"], endpoints(own["ROCO_AGENTS"]), own["ROCO_LISTEN"])
    assert told is not None
    assert told.bind == "0.0.0.0"
    assert told.ends == {
        "router": ("router", 7447),
        **{name: (name, 7448) for name in DESIGN.agents},
    }
    agents = {
        name: service["environment"]
        for name, service in OVER["services"].items()
        if name != "wires"
    }
    assert set(agents) == set(told.ports) == set(DESIGN.agents)
    for name, ports in told.ports.items():
        assert set(ports) == {"router", *DESIGN.peers(name)}
        reached = {end: f"tls/wires:{port}" for end, port in ports.items()}
        assert agents[name]["ROCO_CONNECT"] == reached.pop("router")
        assert endpoints(agents[name]["ROCO_AGENTS"]) == {name: f"tls/{name}:7448", **reached}
    every = [port for ports in told.ports.values() for port in ports.values()]
    assert len(set(every)) == len(every)
    like = ONE["services"]["co"]["environment"]
    assert {key: own[key] for key in ("ROCO_CONNECT", "ROCO_AGENTS")} == {
        key: like[key] for key in ("ROCO_CONNECT", "ROCO_AGENTS")
    }


def test_the_proxy_is_guarded_as_every_service():
    """As co is, but for what it runs; it has no keys, since it decrypts nothing."""
    like = ONE["services"]["co"]
    assert {key: value for key, value in WIRES.items() if key not in OWN} == {
        key: value for key, value in like.items() if key not in OWN
    }
    assert WIRES["volumes"] == ["wires:/var/lib/roco"]
    assert WIRES["healthcheck"] == like["healthcheck"] | {"test": ["CMD", "healthy", "wires"]}
