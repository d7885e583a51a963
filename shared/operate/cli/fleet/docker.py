"""The docker client as a process: what the console asks of it, in words for people where it says no."""

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import msgspec

from operate.cli.errors import DockerError

ANSWER_S = 20.0
"""An answer takes 0.1 s; a loaded machine some seconds (estimate)."""
IMAGES, SYSTEM = "robot-companion/", "robot-companion.system"
"""Beginning of the names of our images; label of a container with any image: the system of its fleet."""
PROJECT, SERVICE = "com.docker.compose.project", "com.docker.compose.service"


class Health(msgspec.Struct, rename="pascal"):
    """Of `docker inspect`: what its health check says."""

    status: str


class State(msgspec.Struct, rename="pascal"):
    """Of `docker inspect`: whether it runs."""

    status: str
    health: Health | None = None
    started_at: str = ""
    exit_code: int = 0


class Config(msgspec.Struct, rename="pascal"):
    """Of `docker inspect`: what it was made with."""

    image: str = ""
    labels: dict[str, str] = {}
    env: list[str] = []


class Networks(msgspec.Struct, rename="pascal"):
    """Of `docker inspect`: the networks it is in, by name."""

    networks: dict[str, Any] = {}


class Container(msgspec.Struct, rename="pascal"):
    """A container, as far as it is wanted."""

    id: str
    state: State
    config: Config
    restart_count: int = 0
    network_settings: Networks = msgspec.field(default_factory=Networks)

    @property
    def service(self) -> str:
        return self.config.labels.get(SERVICE, "")

    @property
    def project(self) -> str:
        return self.config.labels.get(PROJECT, "")

    @property
    def ours(self) -> bool:
        return SYSTEM in self.config.labels or self.config.image.startswith(IMAGES)

    @property
    def runs(self) -> bool:
        return self.state.status == "running"

    @property
    def healthy(self) -> bool:
        return self.state.health is not None and self.state.health.status == "healthy"

    def variable(self, name: str) -> str:
        """The value of a variable of its environment, "" where it is not set."""
        return next((value for key, _, value in (one.partition("=") for one in self.config.env) if key == name), "")


def command(*words: str) -> list[str]:
    """Return the command that calls docker. Raises DockerError if docker is missing."""
    program = shutil.which("docker")
    if program is None:
        raise DockerError("docker is not installed")
    return [program, *words]


def docker(*words: str, timeout_s: float = ANSWER_S, data: bytes = b"") -> bytes:
    """Return docker's output. Raises DockerError if docker is missing, refuses, or does not answer."""
    try:
        done = subprocess.run(command(*words), input=data, capture_output=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        raise DockerError(f"docker did not answer within {timeout_s:.0f} s (docker {words[0]})") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise DockerError(f"docker {words[0]}: {said[0]}")
    return done.stdout


def ours() -> list[Container]:
    """Return the containers of compose projects that are fleets, also those that have ended."""
    listed = docker("ps", "--all", "--quiet", "--no-trunc", "--filter", f"label={PROJECT}").decode().split()
    return [one for one in inspected(listed) if one.ours]


def inspected(ids: list[str]) -> list[Container]:
    """Containers by id."""
    return msgspec.json.decode(docker("inspect", *ids), type=list[Container]) if ids else []


def executed(ids: list[str], script: str) -> list[bytes]:
    """Return the output of a shell script in each container, run in parallel; b"" where it cannot run."""

    def one(id: str) -> bytes:
        try:
            return docker("exec", id, "sh", "-c", script)
        except DockerError:
            return b""

    if not ids:
        return []
    with ThreadPoolExecutor(len(ids)) as together:
        return list(together.map(one, ids))
