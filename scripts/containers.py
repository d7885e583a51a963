"""Docker and Compose as this machine has them: found, called with a time limit, their failures
told.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "deploy" / "compose.yaml"
SERVICES = tuple(
    re.findall(r"^  ([\w-]+):\n    <<: \*service$", FILE.read_text(encoding="utf-8"), re.MULTILINE)
)
"""All but the keeper of the keys."""
# docker-compose 1.29 wants to be asked
BUILDKIT = {"DOCKER_BUILDKIT": "1", "COMPOSE_DOCKER_CLI_BUILD": "1"}
ASK_S = 30.0  # estimate: for a question to the daemon
LOOK_S = 0.2  # estimate: between two looks at what is waited for
Found = TypeVar("Found")


class Failed(Exception):
    """A step did not do what it should; the text says which and what was seen."""


class Docker:
    """The docker client and compose on one project."""

    def __init__(
        self,
        client: str,
        compose: list[str],
        project: str,
        environment: dict[str, str],
        files: tuple[Path, ...] = (FILE,),
    ) -> None:
        self.client, self.project, self.environment = client, project, environment
        named = [part for file in files for part in ("-f", str(file))]
        self._base = [*compose, "-p", project]
        self._compose = [*self._base, *named]

    def run(self, command: list[str], within_s: float) -> str:
        """Return the command's output. Raises Failed if it ends with another code than 0, or not in
        time.
        """
        quiet = {
            "stdin": subprocess.DEVNULL,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.STDOUT,
        }
        with subprocess.Popen(
            command, cwd=ROOT, env=self.environment, text=True, **quiet
        ) as process:
            try:
                text, _ = process.communicate(timeout=within_s)
            except subprocess.TimeoutExpired as late:
                process.kill()
                raise Failed(f"{' '.join(command)}: not done within {within_s:.0f} s") from late
        if process.returncode != 0:
            raise Failed(f"{' '.join(command)}: exit code {process.returncode}\n{text[-3000:]}")
        return text

    def docker(self, *arguments: str, within_s: float = ASK_S) -> str:
        """`docker ...`"""
        return self.run([self.client, *arguments], within_s)

    def compose(self, *arguments: str, within_s: float = ASK_S) -> str:
        """`docker compose ...` of the project"""
        return self.run([*self._compose, *arguments], within_s)

    def elsewhere(self, project: str, file: Path) -> "Docker":
        """Return another project, of a file of its own."""
        return Docker(self.client, self._base[:-2], project, self.environment, (file,))

    def over(self, *files: Path) -> "Docker":
        """The same project with override files."""
        return Docker(self.client, self._base[:-2], self.project, self.environment, (FILE, *files))

    def container(self, service: str) -> str:
        """The id of a service's container; Failed where none runs. Names differ between versions of
        Compose.
        """
        labels = {"project": self.project, "service": service, "oneoff": "False"}
        wanted = [
            part
            for key, value in labels.items()
            for part in ("-f", f"label=com.docker.compose.{key}={value}")
        ]
        found = self.docker("ps", "-q", *wanted).split()
        if not found:
            raise Failed(f"no container of {service} runs")
        return found[0]

    def execute(self, service: str, *command: str, within_s: float = ASK_S) -> str:
        """Return the output of a command run inside a service's container."""
        return self.docker("exec", self.container(service), *command, within_s=within_s)

    def inspect(self, service: str, form: str) -> str:
        """A field of a service's container."""
        return self.docker("inspect", "-f", form, self.container(service)).strip()

    def image_mb(self, image: str) -> float:
        """Size of an image, all layers [MB]."""
        return int(self.docker("image", "inspect", "-f", "{{.Size}}", image)) / 1e6


def find(project: str, settings: dict[str, str]) -> Docker | None:
    """A client whose daemon answers and that can build with BuildKit, and a compose; None where
    there is none.
    """
    clients = [
        str(Path(folder) / "docker") for folder in os.environ.get("PATH", "").split(os.pathsep)
    ]
    answering = [
        client
        for client in dict.fromkeys(clients)
        if os.access(client, os.X_OK) and works(client, "info")
    ]
    # From version 23 on a client builds with a plugin that not every machine has; an older one can
    # by itself.
    client = next(
        (one for one in answering if works(one, "buildx", "version") or version(one) < 23), None
    )
    if client is None:
        return None
    compose = [client, "compose"] if works(client, "compose", "version") else ["docker-compose"]
    if shutil.which(compose[0]) is None:
        return None
    path = os.pathsep.join([str(Path(client).parent), os.environ["PATH"]])
    return Docker(client, compose, project, {**os.environ, **BUILDKIT, **settings, "PATH": path})


def works(*command: str, within_s: float = ASK_S) -> bool:
    """Whether a command ends with 0 in time."""
    try:
        return (
            subprocess.run(command, capture_output=True, timeout=within_s, check=False).returncode
            == 0
        )
    except (OSError, subprocess.TimeoutExpired):
        return False


def version(client: str) -> int:
    """The client's first number."""
    command = [client, "version", "--format", "{{.Client.Version}}"]
    text = subprocess.run(command, capture_output=True, timeout=ASK_S, check=False).stdout.decode()
    number = text.partition(".")[0]
    return int(number) if number.isdecimal() else sys.maxsize


def wait(what: str, within_s: float, look: Callable[[], Found]) -> Found:
    """Return the result of `look`, called until it finds something. Failed says what is missing,
    and why.
    """
    end, why = time.monotonic() + within_s, ""
    while time.monotonic() < end:
        try:
            found = look()
            if found:
                return found
        except (Failed, OSError, ValueError) as error:
            why = f"; last: {str(error)[-500:]}"
        time.sleep(LOOK_S)
    raise Failed(f"{what} within {within_s:.0f} s{why}")
