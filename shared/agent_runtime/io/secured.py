"""A folder of keys as a session needs it: which files an identity opens, and what of Zenoh's
configuration they become.

The folder holds `authority.pem`, `<identity>.pem` and `<identity>.key` of each identity there, and
where the router's are `rights.json` (agent_runtime/keys.py writes it) and, where a key was revoked,
`revoked.json`. Without a folder nothing is encrypted and nobody is asked who it is.
"""

import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.errors import RuntimeFault

AUTHORITY = "authority.pem"
RIGHTS = "rights.json"
LINKS = ".links.json"
"""After the name of an agent: its rules for its neighbours."""
REVOKED = "revoked.json"
ROUTER = "router"
SEND_BUFFER_BYTES = 1_000_000
"""Of the socket of a TLS link. With a size of its own, a busy sender learns of a cut cable within
2.0 to 2.6 s (212,992 to 4,000,000 bytes tried); without one, when the cable is back: the close
waits for a stuck write (measured).
"""

_SEPARATORS = {";", "?"}
"""Of Zenoh's endpoints, where the files of keys become parameters; all other marks were tried and
do no harm.
"""


class Rights(msgspec.Struct, frozen=True):
    """The router's rules for its systems, as `access_control` of its configuration."""

    systems: tuple[str, ...]
    access_control: dict[str, Any]


class KeysError(RuntimeFault):
    """A folder of keys lacks something, or is of another system."""


def certificate_file(folder: Path, identity: str) -> Path:
    return folder / f"{identity}.pem"


def key_file(folder: Path, identity: str) -> Path:
    return folder / f"{identity}.key"


def client_tls(folder: Path, identity: str) -> dict[str, Any]:
    """`transport/link/tls` of a session that is this identity. Raises KeysError."""
    return _dialling(folder, identity) | _tls(folder)


def links_tls(folder: Path, identity: str) -> dict[str, Any]:
    """`transport/link/tls` of an agent that listens to its neighbours, and dials them. Raises
    KeysError.
    """
    return router_tls(folder, identity) | _dialling(folder, identity)


def router_tls(folder: Path, identity: str = ROUTER) -> dict[str, Any]:
    """`transport/link/tls` of the router: a client without a certificate of this authority is
    refused. Raises KeysError.
    """
    certificate, key = _pair(folder, identity)
    return _tls(folder) | {"listen_certificate": certificate, "listen_private_key": key}


def _dialling(folder: Path, identity: str) -> dict[str, Any]:
    certificate, key = _pair(folder, identity)
    own = {"connect_certificate": certificate, "connect_private_key": key}
    return own | {"verify_name_on_connect": True}


def _tls(folder: Path) -> dict[str, Any]:
    return {
        "root_ca_certificate": _file(folder / AUTHORITY),
        "enable_mtls": True,
        "close_link_on_expiration": True,
        "so_sndbuf": SEND_BUFFER_BYTES,
    }


def rights_of(folder: Path, *systems: str) -> Rights:
    """The router's rights in a folder. Raises KeysError where they are of other systems."""
    rights = _rights(folder / RIGHTS)
    missing = ", ".join(repr(system) for system in systems if system not in rights.systems)
    if missing:
        there = ", ".join(repr(system) for system in rights.systems)
        raise KeysError(
            f"the rights in {folder} are of system {there}, this router serves {missing}:"
            f" everything would be denied; make keys for {missing}"
        )
    return rights


def links_of(folder: Path, agent: str) -> dict[str, Any]:
    """An agent's rules for its neighbours, without those whose keys are revoked. Raises
    KeysError.
    """
    return granted(_rights(links_file(folder, agent)).access_control, revoked(folder))


def _rights(file: Path) -> Rights:
    try:
        return msgspec.json.decode(Path(_file(file)).read_bytes(), type=Rights)
    except msgspec.MsgspecError as error:
        raise KeysError(f"{file} cannot be read ({error}); make the keys again") from error


def links_file(folder: Path, agent: str) -> Path:
    """The file of an agent's rules for its neighbours."""
    return folder / f"{agent}{LINKS}"


def age(folder: Path, identity: str) -> tuple[int, int] | None:
    """When the key of an identity was written, and the list of revoked ones; None: there is no key
    (now); 0: no list.
    """
    try:
        made = key_file(folder, identity).stat().st_mtime_ns
    except OSError:
        return None
    with suppress(OSError):
        return made, (folder / REVOKED).stat().st_mtime_ns
    return made, 0


def revoked(folder: Path) -> tuple[str, ...]:
    """The common names whose certificates are of no use any more, sorted. Raise KeysError."""
    try:
        return msgspec.json.decode((folder / REVOKED).read_bytes(), type=tuple[str, ...])
    except FileNotFoundError:
        return ()
    except (OSError, msgspec.MsgspecError) as error:
        raise KeysError(
            f"{folder / REVOKED} cannot be read ({error}); write a JSON list of names, or make the"
            " keys again"
        ) from error


def granted(access_control: dict[str, Any], denied: tuple[str, ...]) -> dict[str, Any]:
    """The router's rules without those for common names that are denied: what no rule allows is
    refused.
    """
    kept = [
        policy for policy in access_control["policies"] if not set(policy["subjects"]) & set(denied)
    ]
    return access_control | {"policies": kept}


def _pair(folder: Path, identity: str) -> tuple[str, str]:
    return _file(certificate_file(folder, identity)), _file(key_file(folder, identity))


def _file(path: Path) -> str:
    if not path.is_file():
        there = ", ".join(sorted(one.stem for one in path.parent.glob("*.key"))) or "none"
        raise KeysError(
            f"{path} is missing; identities with a key there: {there}; `roco keys make` writes all"
            " of them"
        )
    whole = path.resolve()
    return f"{_opened(whole.parent)}/{path.name}" if _SEPARATORS & set(str(whole)) else str(whole)


@cache
def _opened(folder: Path) -> str:
    """Another name of a folder, as long as this process lives: the folder as it has it open."""
    return f"/proc/self/fd/{os.open(folder, os.O_PATH | os.O_CLOEXEC)}"
