"""The images of the fleet: made, also where none can be pulled; how large they are, and what is in
which.
"""

import hashlib
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from containers import ROOT, Docker, Failed, works

PUBLIC_BASE = "python:3.11-slim-bookworm"
OWN_BASE = "robot-companion/base:bookworm"
WHEELHOUSE = ROOT / "deploy/wheelhouse"
TARGETS = {
    "agent": "router",
    "knowledge": "km",
    "planner": "pl",
    "executor": "ex",
    "monitor": "monitor",
    "page": "page",
}
"""Image -> a service that is built from it."""
RECORDER = "recorder"
"""The image that takes the monitor's place where ROCO_MONITOR names it."""
IMAGES = (*TARGETS, RECORDER)
MOST_MB = {
    "agent": 150.0,
    "knowledge": 150.0,
    "page": 150.0,
    "planner": 550.0,
    "executor": 800.0,
    "monitor": 700.0,
    RECORDER: 250.0,
}
"""Over the base; 5 % and more above the sizes measured (docs/deploy.md), so that another large
library is found.
"""
ALONE = {
    "mujoco": "executor",
    "cv2": "executor",
    "rerun": "monitor",
    "matplotlib": "monitor",
    "PIL": "monitor",
}
"""Library -> the only image that has it."""

# Longest it may take [s]; estimates: three times and more what a loaded 2-core machine needs.
PULL_S, INSTALL_S, BASE_S, WHEELS_S, BUILD_S, LOOK_S = 20.0, 180.0, 300.0, 300.0, 1200.0, 60.0

Say = Callable[[str], None]


def name(docker: Docker, image: str) -> str:
    """The image as the compose file names it."""
    return f"robot-companion/{image}:{docker.environment.get('ROCO_TAG', 'latest')}"


def prepare(docker: Docker, say: Say, *, offline: bool, online: bool) -> None:
    """Prepare base image and wheels where no image can be pulled, unless they are left from an
    earlier call.
    """
    if not (offline or online):
        offline = not works(docker.client, "pull", "-q", PUBLIC_BASE, within_s=PULL_S)
        say(f"{PUBLIC_BASE} {'cannot' if offline else 'can'} be pulled")
    if not offline:
        return
    docker.environment |= {"BASE_IMAGE": OWN_BASE, "PIP_ARGS": "--no-index"}
    if works(docker.client, "image", "inspect", OWN_BASE):
        say(f"the base image {OWN_BASE} is there")
    else:
        debootstrap(docker, say)
        say(f"making the base image {OWN_BASE} from Debian's packages")
        docker.run([str(ROOT / "deploy/make-base"), OWN_BASE], BASE_S)
    wheels(docker, say)


def debootstrap(docker: Docker, say: Say) -> None:
    """See that mmdebstrap is there. Failed where it is not and we may not install it."""
    if shutil.which("mmdebstrap") is not None:
        return
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        raise Failed(
            "mmdebstrap is not here, and no base image can be pulled (Debian: apt install"
            " mmdebstrap)"
        )
    say("installing mmdebstrap by apt")
    docker.environment["DEBIAN_FRONTEND"] = "noninteractive"
    docker.run(["apt-get", "update", "-q"], INSTALL_S)
    docker.run(
        ["apt-get", "install", "-q", "-y", "--no-install-recommends", "mmdebstrap"], INSTALL_S
    )


def wheels(docker: Docker, say: Say) -> None:
    """Fetch the wheels that are locked; a stamp beside them says for which lock they are there."""
    locks = sorted((ROOT / "requirements").glob("*.txt"))
    lock = hashlib.sha256(b"".join(file.read_bytes() for file in locks)).hexdigest()
    stamp = WHEELHOUSE / ".lock"
    if stamp.is_file() and stamp.read_text() == lock:
        say("the wheels are there")
        return
    say("fetching the wheels")
    own = ROOT / ".venv/bin/python"
    docker.run(
        [str(ROOT / "deploy/make-wheelhouse"), str(own) if own.exists() else sys.executable],
        WHEELS_S,
    )
    stamp.write_text(lock)


def build(docker: Docker, say: Say) -> None:
    """All images; one service for each, since docker-compose 1.29 asks the builder again for every
    service.
    """
    say("building the images")
    docker.compose("build", *TARGETS.values(), within_s=BUILD_S)
    with recorder(docker):
        docker.compose("build", TARGETS["monitor"], within_s=BUILD_S)
    if (ROOT / ".venv").exists():
        docker.run([str(ROOT / "scripts/sbom")], LOOK_S)
        say("what is in them: dist/*.cdx.json, dist/*.notices.txt")


@contextmanager
def recorder(docker: Docker) -> Iterator[None]:
    """For a while the monitor is the one without pictures."""
    docker.environment["ROCO_MONITOR"] = RECORDER
    try:
        yield
    finally:
        del docker.environment["ROCO_MONITOR"]


def check(docker: Docker, say: Say) -> None:
    """Sizes over the base, and that a library that is in one image is in no other. Failed names
    what is not so.
    """
    base = docker.image_mb(docker.environment.get("BASE_IMAGE", PUBLIC_BASE))
    over = {image: docker.image_mb(name(docker, image)) - base for image in IMAGES}
    say(
        f"MB over the base of {base:.0f}:"
        f" {', '.join(f'{image} {mb:.0f}' for image, mb in over.items())}"
    )
    large = [
        f"{image} is {over[image]:.0f} MB over the base, more than {mb:.0f}"
        for image, mb in MOST_MB.items()
    ]
    wrong = [
        text for text, image in zip(large, MOST_MB, strict=True) if over[image] > MOST_MB[image]
    ]
    look = (
        f"import importlib.util as u, json; print(json.dumps([n for n in {list(ALONE)!r} if"
        " u.find_spec(n)]))"
    )
    for image in IMAGES:
        run = (
            "run",
            "--rm",
            "--network",
            "none",
            "--entrypoint",
            "/opt/venv/bin/python",
            name(docker, image),
        )
        has = set(json.loads(docker.docker(*run, "-c", look, within_s=LOOK_S)))
        should = {library for library, only in ALONE.items() if only == image}
        wrong += [f"{image} has {library}" for library in has - should]
        wrong += [f"{image} has no {library}" for library in should - has]
    if wrong:
        raise Failed("; ".join(wrong))


def prune(docker: Docker) -> None:
    """Remove what was built."""
    for image in (*(name(docker, image) for image in IMAGES), OWN_BASE):
        works(docker.client, "image", "rm", image, within_s=LOOK_S)
    works(docker.client, "builder", "prune", "-f", within_s=LOOK_S)
    for file in (*WHEELHOUSE.glob("*.whl"), WHEELHOUSE / ".lock"):
        file.unlink(missing_ok=True)
