"""deploy/compose.faults.yaml: a wire for each agent, guarded as every service is, and nothing else changed."""

from pathlib import Path

import yaml

from companion.design import DESIGN
from operate.wires import files

ROOT = Path(__file__).resolve().parents[2]
ONE = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())
OVER = yaml.safe_load((ROOT / "deploy/compose.faults.yaml").read_text())
WIRES = OVER["services"]["wires"]
OWN = {"command", "environment", "volumes", "depends_on", "healthcheck", "mem_limit"}


def test_each_agent_reaches_the_router_by_a_wire_of_its_own():
    """The proxy listens for each where that one is told to connect, and goes on to the router's endpoint."""
    told = files.listed(WIRES["environment"]["ROCO_CONNECT"], WIRES["environment"]["ROCO_LISTEN"])
    assert told is not None
    assert (told.ends, told.bind) == ({"router": ("router", 7447), "router-2": ("router-2", 7447)}, "0.0.0.0")
    agents = {name: service for name, service in OVER["services"].items() if name != "wires"}
    assert agents == {
        name: {"environment": {"ROCO_CONNECT": ",".join(f"tls/wires:{port}" for port in ports.values())}}
        for name, ports in told.ports.items()
    }
    assert set(agents) == set(DESIGN.agents)
    assert len({port for ports in told.ports.values() for port in ports.values()}) == 2 * len(agents)
    assert ONE["services"]["co"]["environment"]["ROCO_CONNECT"] == WIRES["environment"]["ROCO_CONNECT"]


def test_the_proxy_is_guarded_as_every_service():
    """As co is, but for what it runs; it has no keys, since it decrypts nothing."""
    like = ONE["services"]["co"]
    assert {key: value for key, value in WIRES.items() if key not in OWN} == {
        key: value for key, value in like.items() if key not in OWN
    }
    assert WIRES["volumes"] == ["wires:/var/lib/roco"]
    assert WIRES["healthcheck"] == like["healthcheck"] | {"test": ["CMD", "healthy", "wires"]}
