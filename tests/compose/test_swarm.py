"""deploy/compose.yaml without what is marked, and compose.swarm.yaml: what a swarm gets, and no key
too many.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from companion.design import DESIGN
from companion.tools.system import PROCESSES

pytestmark = pytest.mark.process

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
SCRIPT = (DEPLOY / "swarm").read_text()
OVERRIDE = yaml.safe_load((DEPLOY / "compose.swarm.yaml").read_text())
REFUSED = {"depends_on", "mem_limit", "pids_limit", "profiles", "cpuset"}
"""Keys of a service for which `docker stack deploy` refuses the whole file (28.2)."""
IGNORED = {"build", "restart", "security_opt", "network_mode", "cgroup_parent"}
"""Keys that it warns of."""


def filtered():
    """The file as the script's own filter leaves it."""
    (filter_,) = re.findall(r"^    (sed .*)$", SCRIPT, re.MULTILINE)
    command = filter_.replace("$here", str(DEPLOY))
    return subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, check=True, timeout=20.0
    ).stdout


STACK = yaml.safe_load(filtered())
every_service = pytest.mark.parametrize("name", STACK["services"])


def test_all_services_are_there_but_the_keeper_of_the_keys_and_the_page():
    """Secrets take the place of the one; the port of the other would be published on all
    addresses.
    """
    wanted = {process.name for process in PROCESSES} - {"loop", "page"}
    assert set(STACK["services"]) == set(OVERRIDE["services"]) == wanted
    assert set(STACK["volumes"]) == wanted


@every_service
def test_nothing_is_left_that_a_swarm_refuses_or_ignores(name):
    """An ignored setting would look as if it held."""
    assert not (REFUSED | IGNORED) & set(STACK["services"][name])
    assert not any("127.0.0.1" in port for port in STACK["services"][name].get("ports", ()))


@every_service
def test_what_guards_a_service_stays(name):
    """As far as a swarm can."""
    service = STACK["services"][name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["init"] is True
    whole = yaml.safe_load((DEPLOY / "compose.yaml").read_text())["services"][name]
    limits = OVERRIDE["services"][name]["deploy"]["resources"]["limits"]
    assert limits == {"memory": whole["mem_limit"], "pids": whole["pids_limit"]}


@every_service
def test_a_service_gets_its_own_key_and_no_other(name):
    """As files that only its user reads, where it looks for them."""
    service = OVERRIDE["services"][name]
    targets = {secret["source"]: secret["target"] for secret in service["secrets"]}
    own = {
        "authority": "authority.pem",
        f"{name}-certificate": f"{name}.pem",
        f"{name}-key": f"{name}.key",
    }
    rules = {"rights": "rights.json"} if name == "router" else {}
    rules |= {f"{name}-links": f"{name}.links.json"} if name in DESIGN.agents else {}
    assert targets == own | rules
    assert all(
        secret["uid"] == "10001" and secret["mode"] == 0o400 for secret in service["secrets"]
    )
    assert service["environment"] == {"ROCO_TLS_DIR": "/run/secrets", "ROCO_HEALTHY": "alive"}
    assert STACK["services"][name]["environment"]["ROCO_CONNECT"].startswith("tls/")


def test_secrets_are_named_for_when_they_were_made():
    """A secret never changes: new keys under an old name would be refused."""
    endings = {"certificate": ".pem", "key": ".key", "links": ".links.json"}
    for name, secret in OVERRIDE["secrets"].items():
        assert secret["name"] == f"${{ROCO_STACK}}-{name}-${{ROCO_KEYS_OF}}"
        identity, _, kind = name.rpartition("-")
        shared = {"authority": "router/authority.pem", "rights": "router/rights.json"}
        file = shared.get(name) or f"{identity}/{identity}{endings[kind]}"
        assert secret["file"].partition("}")[2] == f"/{file}"


@every_service
def test_the_body_runs_where_the_body_is(name):
    """All others where the mind is: labels of nodes."""
    wanted = "node.labels.roco-body == true" if name == "ex" else "node.labels.roco-mind == true"
    assert OVERRIDE["services"][name]["deploy"]["placement"]["constraints"] == [wanted]


def test_without_a_labelled_node_nothing_is_deployed(tmp_path):
    """And the sentence says which command labels one."""
    calls = tmp_path / "calls"
    docker = tmp_path / "docker"
    answers = 'case "$1 $2" in "node ls") echo n1;; "node inspect") echo;; esac'
    docker.write_text(f'#!/bin/sh\necho "$@" >>{calls}\n{answers}\n')
    docker.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(
        [DEPLOY / "swarm"], env=environment, capture_output=True, text=True, timeout=20.0
    )
    assert done.returncode == 2
    assert "docker node update --label-add roco-body=true NODE" in done.stderr
    assert "deploy" not in calls.read_text()
