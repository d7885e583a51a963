#!/usr/bin/env python3
"""A pretended docker: containers are folders below $FAKE_DOCKER; a script that is to be run there
is run here.

A container's folder has a file `state`; its name is <project>.<service>, which is its id, too.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(os.environ["FAKE_DOCKER"])


def described(folder: Path) -> dict[str, object]:
    """Return the answer of `docker inspect` for a container."""
    project, service = folder.name.split(".")
    labels = {"com.docker.compose.project": project, "com.docker.compose.service": service}
    image = "robot-companion/agent:test" if project != "other" else "redis"
    return {
        "Id": folder.name,
        "State": {"Status": (folder / "state").read_text(), "ExitCode": 0, "Health": None},
        "Config": {"Image": image, "Labels": labels, "Env": environment(folder)},
        "RestartCount": 0,
    }


def environment(folder: Path) -> list[str]:
    """Return the contents of its file `environment`, if it has one."""
    file = folder / "environment"
    return file.read_text().splitlines() if file.exists() else ["ROCO_SYSTEM=roco"]


def main(words: list[str]) -> int:
    """Do one command."""
    match words:
        case ["ps", *_]:
            print("\n".join(sorted(folder.name for folder in ROOT.iterdir())))
        case ["inspect", *ids]:
            print(json.dumps([described(ROOT / id) for id in ids]))
        case ["exec", "--interactive", id, *command] | ["exec", id, *command]:
            if (ROOT / id / "state").read_text() != "running":
                print("container is not running", file=sys.stderr)
                return 1
            return subprocess.run(
                command, env=os.environ | {"ROCO_RUN_DIR": str(ROOT / id)}, check=False
            ).returncode
        case ["version", *_]:
            print("28.2.2")
        case ["compose", "version", "--short"] if (ROOT / "compose").exists():
            print("2.26.1")
        case ["start" | "stop" as order, *ids]:
            for id in ids:
                (ROOT / id / "state").write_text("running" if order == "start" else "exited")
        case ["run", "--rm", *rest]:
            options = [one.partition("=") for one in rest if one.startswith("--")]
            told = dict(value.split("=", 1) for name, _, value in options if name == "--env")
            (home,) = (value for name, _, value in options if name == "--volumes-from")
            module, *words = rest[rest.index("robot-companion/agent:test") + 1 :]
            shared = os.environ | told | {"ROCO_RUN_DIR": str(ROOT / home)}
            return subprocess.run(["python", "-m", module, *words], env=shared).returncode
        case ["logs", *_]:
            print("a line of it")
        case _:
            print(f"no such command: {words}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
