"""deploy/compose.two.yaml: the second robot is as the first one, but for its name, its files, its
keys and its port.
"""

from pathlib import Path

import pytest
import yaml

from agent_runtime.io import issuing
from companion.design import DESIGN
from companion.tools.key_folders import FOLDERS

ROOT = Path(__file__).resolve().parents[2]
ONE = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())
TWO = yaml.safe_load((ROOT / "deploy/compose.two.yaml").read_text())
SYSTEMS = ("velma1", "velma2")
SHARED = {"keys", "router", "monitor"}
AGENTS = sorted(DESIGN.agents)


def renamed(service):
    """Return the second robot's service, made of the first one's."""
    text = yaml.safe_dump(service).replace("ROCO_PORT", "ROCO_PORT2").replace("8350", "8360")
    return yaml.safe_load(text)


def volumes(name, system=""):
    """An agent's own files and its own keys, and nobody else's."""
    return [f"{name}{system}:/var/lib/roco", f"keys-{name}{system}:/var/lib/roco-keys:ro"]


@pytest.mark.parametrize("name", AGENTS)
def test_the_second_robot_is_as_the_first(name):
    """Same image, guards, limits, health and order; its own volumes, and its own name in front of
    every key.
    """
    second, first = TWO["services"][f"{name}2"], renamed(ONE["services"][name])
    # to the page, which the first one alone has
    lent = ["address:/var/lib/roco-address"] if name == "hi" else []
    assert first.pop("volumes") == volumes(name) + lent
    first["environment"].pop("ROCO_HI_DIR", None)
    assert second["volumes"] == volumes(name, "2")
    elsewhere = ",".join(f"{one}=tls/{one}2:7448" for one in ONE["services"] if one in AGENTS)
    first["environment"] |= {"ROCO_SYSTEM": SYSTEMS[1], "ROCO_AGENTS": elsewhere}
    assert {key: value for key, value in second.items() if key != "volumes"} == first


def test_nothing_else_is_there_or_changed():
    """The first robot gets its name, those that serve both get both names, the keeper the folders
    of all keys.
    """
    services = TWO["services"]
    assert set(services) == {*SHARED, *AGENTS, "page", *(f"{name}2" for name in AGENTS)}
    for name in (*AGENTS, "page"):
        assert services[name] == {"environment": {"ROCO_SYSTEM": SYSTEMS[0]}}
    for name in SHARED:
        hosts = {"ROCO_HOSTS": " ".join(f"{one}2" for one in ONE["services"] if one in AGENTS)}
        assert services[name]["environment"] == {"ROCO_SYSTEMS": ",".join(SYSTEMS)} | (
            hosts if name == "keys" else {}
        )
        assert set(services[name]) <= {
            "environment",
            "volumes",
            "ports",
            "mem_limit",
            "stop_grace_period",
        }
    mounted = {
        volume.split(":")[0] for name in AGENTS for volume in services[f"{name}2"]["volumes"]
    }
    assert set(TWO["volumes"]) == mounted | {f"keys-{name}2" for name in DESIGN.guests}


def test_the_keeper_of_the_keys_writes_each_where_its_agent_reads():
    """Every folder that `roco keys make --apart` writes is a volume of its own, and is in the image
    for its owner.
    """
    kept = [*ONE["services"]["keys"]["volumes"], *TWO["services"]["keys"]["volumes"]]
    folders = {target: volume for volume, target in (one.split(":") for one in kept)}
    for seat in issuing.seats(Path("/keys"), DESIGN, SYSTEMS, apart=True):
        robot = "2" if seat.name.startswith(SYSTEMS[1]) else ""
        assert folders[str(seat.folder)] == f"keys-{seat.identity}{robot}"
        assert str(seat.folder) in FOLDERS
