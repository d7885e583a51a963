"""The file of robots and orders: where the fleet of each included system runs, and what people want done.

It is the scene of `roco up` here, else dispatch.toml beside the package.
"""

import tomllib
from pathlib import Path

import msgspec
from companion.design import AnyCommand

FILE = Path(__file__).parents[1] / "dispatch.toml"


class Order(msgspec.Struct, frozen=True):
    """Somebody wants this done; `at_s`: seconds after the start."""

    task: AnyCommand
    at_s: float = 0.0


class Orders(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`robots`: include -> run folder of its fleet, from the file's folder."""

    robots: dict[str, str]
    order: tuple[Order, ...] = ()


def read(path: Path | None) -> Orders:
    """Raise ValueError, which says what does not fit."""
    file = path or FILE
    try:
        found = msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8")), Orders)
    except (OSError, ValueError) as error:  # msgspec's and tomllib's are ValueErrors
        raise ValueError(f"{file}: {error}; dispatch.toml of the example shows how it is written") from error
    robots = {name: str(file.resolve().parent / run) for name, run in found.robots.items()}
    return msgspec.structs.replace(found, robots=robots)
