"""deploy/compose.yaml says the same guards of every service, and the fleet it brings up is the
supervisor's.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from agent_runtime.io.cli import endpoints
from companion.design import DESIGN
from companion.tools.key_folders import FOLDERS
from companion.tools.system import PROCESSES
from operate.fault_proxy import files
from topdown.model.rights import identities

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "deploy/compose.yaml").read_text()
FILE = yaml.safe_load(TEXT)
KEEPER = FILE["services"]["keys"]
"""Makes the keys of all; no process of the fleet."""
SERVICES = {name: service for name, service in FILE["services"].items() if name != "keys"}
DOCKERFILE = (ROOT / "deploy/Dockerfile").read_text()
INSIDE = {"ex": {"ex", "loop"}}
"""Services of more than one process; there a supervisor keeps them."""

every_service = pytest.mark.parametrize("name", SERVICES)


def test_all_processes_of_the_fleet_are_there():
    """Those of the supervisor's table, each in one service."""
    inside = [process for name in SERVICES for process in INSIDE.get(name, {name})]
    assert sorted(inside) == sorted(process.name for process in PROCESSES)


def target(service):
    """The stage that is built for a service where nothing is set."""
    return re.sub(r"\$\{\w+:-(\w+)\}", r"\1", service["build"]["target"])


def command(name):
    """Return the command of a service: its own, else that of its image."""
    if "command" in SERVICES[name]:
        return SERVICES[name]["command"]
    stage = DOCKERFILE.split(f" AS {target(SERVICES[name])}\n")[1].split("\nFROM ")[0]
    return yaml.safe_load(re.search(r"^CMD (.*)$", stage, re.MULTILINE)[1])


@every_service
def test_a_service_runs_what_the_supervisor_would_run(name):
    """The same module, or the supervisor with just the processes that belong together."""
    modules = {process.name: process.module for process in PROCESSES}
    if name in INSIDE:
        module, only, names = command(name)
        assert (module, only) == ("services.supervisor", "--only")
        assert set(names.split(",")) == INSIDE[name]
    else:
        assert command(name) == [modules[name]]


@pytest.mark.parametrize("name", FILE["services"])
def test_a_service_has_no_rights(name):
    """Root read-only, no capability, no way to get one."""
    service = FILE["services"][name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert not {"privileged", "cap_add", "user", "pid", "ipc", "devices"} & set(service)
    assert service.get("network_mode") == ("none" if name == "keys" else None)


@every_service
def test_a_service_can_change_nothing_but_its_own_volume(name):
    """One that no other service has; its keys it may only read. hi lends its address to the
    page.
    """
    lent = {"hi": ["address:/var/lib/roco-address"], "page": ["address:/var/lib/roco-address:ro"]}
    own = [f"{name}:/var/lib/roco", f"keys-{name}:/var/lib/roco-keys:ro"]
    assert SERVICES[name]["volumes"] == own + lent.get(name, [])
    assert {name, f"keys-{name}"} <= set(FILE["volumes"])


def test_the_keys_of_all_are_in_one_place_which_has_no_network():
    """Each identity of the design and the router in a volume of its own, of which the image knows
    the owner.
    """
    names = identities(DESIGN)
    assert sorted(KEEPER["volumes"]) == sorted(f"keys-{name}:/keys/{name}" for name in names)
    assert {f"/keys/{name}" for name in names} <= set(FOLDERS)
    assert (
        "from companion.tools.key_folders import FOLDERS"
        in DOCKERFILE.split(" AS agent\n")[1].split("\nFROM ")[0]
    )
    assert KEEPER["network_mode"] == "none"
    assert "networks" not in KEEPER


@every_service
def test_nobody_speaks_without_a_key(name):
    """TLS is what is there, not what may be had."""
    environment = SERVICES[name]["environment"]
    assert environment["ROCO_TLS_DIR"] == "/var/lib/roco-keys"
    assert environment["ROCO_CONNECT"] == "tls/router:7447"
    ports = {"router": 7447, **dict.fromkeys(DESIGN.agents, 7448)}
    assert environment.get("ROCO_LISTEN") == (
        f"tls/0.0.0.0:{ports[name]}" if name in ports else None
    )


@every_service
def test_every_container_has_the_time_zone_of_who_starts_it(name):
    """ "At noon" of who tells no zone is by the clock of hi, and logs have times."""
    assert SERVICES[name]["environment"]["TZ"] == "${TZ:-}"


@every_service
def test_each_agent_is_told_where_all_agents_listen(name):
    """At the port at which each listens, by the name of its service."""
    told = endpoints(SERVICES[name]["environment"].get("ROCO_AGENTS", ""))
    listens = {
        one: SERVICES[one]["environment"]["ROCO_LISTEN"].replace("0.0.0.0", one)
        for one in DESIGN.agents
    }
    assert told == (listens if name in DESIGN.agents else {})


@pytest.mark.parametrize("name", FILE["services"])
def test_a_service_is_bounded(name):
    """Memory, processes, the log that Docker keeps, and the time it may take to end."""
    service = FILE["services"][name]
    assert re.fullmatch(r"\d+[mg]", service["mem_limit"])
    assert service["pids_limit"] <= 256
    assert service["ulimits"] == {"core": 0, "nofile": 4096}
    # limits of both kinds: Compose v2 refuses the file, v1 one of the kinds
    assert "deploy" not in service
    assert service["logging"]["options"] == {"max-size": "10m", "max-file": "3"}
    assert service["stop_grace_period"] in ("15s", "60s")
    assert service["restart"] == "unless-stopped"


@pytest.mark.parametrize("file", ["compose.yaml", "compose.two.yaml"])
def test_what_is_built_is_not_pulled(file):
    """Nobody publishes the images: Compose v2 would try first."""
    services = yaml.safe_load((ROOT / "deploy" / file).read_text())["services"]
    assert services
    for service in services.values():
        assert (
            ("build" in service) == ("image" in service) == (service.get("pull_policy") == "build")
        )


@every_service
def test_health_starts_no_python(name):
    """It reads what the processes write anyway, for each process inside."""
    program, *names = SERVICES[name]["healthcheck"]["test"][1:]
    assert program == "healthy"
    assert set(names) == (INSIDE[name] | {"supervisor"} if name in INSIDE else {name})
    text = (ROOT / "deploy/healthy").read_text().lower().splitlines()
    assert not any("python" in line for line in text if not line.startswith("#"))


@every_service
def test_agents_start_when_the_router_routes_and_the_monitor_taps(name):
    """As the supervisor's table says."""
    wanted = {other for process in PROCESSES if process.name == name for other in process.after} - {
        "loop"
    }
    after = SERVICES[name].get("depends_on", {})
    assert set(after) == (wanted or {"keys"})
    assert all(condition == {"condition": "service_healthy"} for condition in after.values())


def test_only_people_reach_in_and_nobody_reaches_out():
    """Ports on loopback alone, the same inside and outside: hi compares it with the request's Host,
    and Rerun's page asks for its data at the number it was given.
    """
    assert FILE["networks"]["fleet"] == {"internal": True}
    inside = {
        "hi": ["ROCO_PORT"],
        "page": ["ROCO_PAGE_PORT"],
        "monitor": ["ROCO_VIEW_WEB", "ROCO_VIEW_GRPC"],
    }
    for name, service in FILE["services"].items():
        assert ("people" in service.get("networks", ())) == (name in inside)
        assert len(service.get("ports", ())) == len(inside.get(name, ()))
        for port, variable in zip(service.get("ports", ()), inside.get(name, ()), strict=True):
            assert re.fullmatch(r"127\.0\.0\.1:(\$\{" + variable + r":-\d+\}):\1", port)
            told = service["environment"][
                {"hi": "ROCO_HTTP", "page": "ROCO_PAGE"}.get(name, variable)
            ]
            assert (
                told.removeprefix("0.0.0.0:")
                == port.removeprefix("127.0.0.1:")[: len(told.removeprefix("0.0.0.0:"))]
            )


def test_nothing_needs_to_be_set():
    """`docker compose up` is the first command: every variable has a default. `version` is ignored
    by Compose v2.
    """
    assert all(":-" in variable for variable in re.findall(r"\$\{[^}]*\}", TEXT))
    assert "version" not in FILE


def test_only_the_override_for_hard_timing_gives_rights():
    """To the executor alone, and just those it needs."""
    override = yaml.safe_load((ROOT / "deploy/compose.rt.yaml").read_text())["services"]
    assert set(override) == {"ex"}
    assert override["ex"]["cap_add"] == ["SYS_NICE", "IPC_LOCK", "DAC_READ_SEARCH"]


@pytest.mark.parametrize("stage", sorted({*map(target, SERVICES.values()), "recorder"}))
def test_every_image_is_locked_checked_and_not_root(stage):
    """Each ends with the imports of what it runs and another user than root; each install compares
    hashes.
    """
    text = DOCKERFILE.split(f" AS {stage}\n")[1].split("\nFROM ")[0]
    assert re.search(
        r"^RUN (?:python [^']* && )?python -c '[^']*\bimport services\.", text, re.MULTILINE
    )
    assert re.search(r"^USER roco$", text, re.MULTILINE)
    for name, service in SERVICES.items():
        if target(service) == stage or (name, stage) == ("monitor", "recorder"):
            module = command(name)[0]
            assert f"{module}.__main__" in text, f"{stage} does not check {module}"


def test_images_are_compiled_when_they_are_built():
    """No process writes byte code: Python's own library is compiled, and pip compiles what it
    installs.
    """
    base = DOCKERFILE.split(" AS base\n")[1].split("\nFROM ")[0]
    assert "PYTHONDONTWRITEBYTECODE=1" in base
    assert re.search(r"^RUN python3 -m compileall ", base, re.MULTILINE)
    assert "--no-compile" not in DOCKERFILE


def test_every_install_is_from_a_lock_file():
    """With hashes; but for the project itself, which is built from source."""
    installs = [
        line
        for line in DOCKERFILE.replace("\\\n", " ").splitlines()
        if re.search(r"\bpip\b.* install ", line)
    ]
    assert installs
    for line in installs:
        assert "--require-hashes" in line or "--no-deps --no-index --prefix /opt/project" in line
    for name in re.findall(r"requirements/(\S+\.txt) ", DOCKERFILE):
        assert "--hash=sha256:" in (ROOT / "requirements" / name).read_text()


# --- compose.faults.yaml: a wire for each agent, guarded as every service is ----------------------


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
    like = FILE["services"]["co"]["environment"]
    assert {key: own[key] for key in ("ROCO_CONNECT", "ROCO_AGENTS")} == {
        key: like[key] for key in ("ROCO_CONNECT", "ROCO_AGENTS")
    }


def test_the_proxy_is_guarded_as_every_service():
    """As co is, but for what it runs; it has no keys, since it decrypts nothing."""
    like = FILE["services"]["co"]
    assert {key: value for key, value in WIRES.items() if key not in OWN} == {
        key: value for key, value in like.items() if key not in OWN
    }
    assert WIRES["volumes"] == ["wires:/var/lib/roco"]
    assert WIRES["healthcheck"] == like["healthcheck"] | {"test": ["CMD", "healthy", "wires"]}


# --- compose.fipa.yaml: the gateway to other FIPA platforms ---------------------------------------


FIPA = yaml.safe_load((ROOT / "deploy/compose.fipa.yaml").read_text())["services"]


def test_the_gateway_to_other_platforms_is_guarded_as_every_service_and_off_by_default():
    """It has the keys of the guest alone, and takes messages on its own loopback."""
    assert list(FIPA) == ["fipa"]
    assert "fipa" not in FILE["services"]
    like, gateway = FILE["services"]["co"], FIPA["fipa"]
    assert {key: value for key, value in gateway.items() if key not in OWN} == {
        key: value for key, value in like.items() if key not in OWN
    }
    assert gateway["volumes"] == ["fipa:/var/lib/roco", "keys-platform:/var/lib/roco-keys:ro"]
    assert gateway["command"] == "console fipa --at 127.0.0.1:8372 ${ROCO_FIPA:-}"
    assert not gateway.get("ports")
    assert gateway["environment"].items() <= like["environment"].items()
    assert gateway["healthcheck"] == like["healthcheck"] | {"test": ["CMD", "healthy", "fipa"]}
    assert "console.fleet.platforms" in DOCKERFILE.split(" AS agent\n")[1].split("\nFROM ")[0]


COMPOSE = shutil.which("docker-compose")


@pytest.mark.skipif(not COMPOSE, reason="needs docker-compose (Debian: apt install docker-compose)")
@pytest.mark.parametrize("over", ["compose.fipa.yaml", "compose.rt.yaml", "compose.two.yaml"])
def test_compose_takes_the_files_together(over):
    """Of version 1, too; the options of the gateway are words of its command."""
    files = [word for name in ("compose.yaml", over) for word in ("-f", f"{ROOT}/deploy/{name}")]
    done = subprocess.run(
        [str(COMPOSE), *files, "config"],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
        env=os.environ | {"ROCO_FIPA": "--agreed --df df@lab=http://127.0.0.1:7778/acc"},
    )
    assert done.returncode == 0, done.stderr
    made = yaml.safe_load(done.stdout)["services"]
    if over == "compose.fipa.yaml":
        command = made["fipa"]["command"]
        words = command.split() if isinstance(command, str) else command
        assert words[4:] == ["--agreed", "--df", "df@lab=http://127.0.0.1:7778/acc"]
