"""Checks of `roco doctor` between a fleet's processes and its router: processes that are refused, and the reason."""

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress

from agent_runtime.io.reaching import why_not
from agent_runtime.io.run_files import KEYS_FOLDER
from agent_runtime.io.secured import ROUTER, key_file
from operate.cli.errors import ConsoleError
from operate.cli.fleet import identity
from operate.cli.fleet.checkup import Check, Level
from operate.cli.fleet.local import Local
from operate.cli.fleet.process_status import Look, Seen
from operate.cli.fleet.targets import Target
from operate.run_folder import Fleet

LINES = 1000
"""Lines of the router's log that are looked at, the last ones: one of Zenoh's for each refusal (estimate)."""
_REFUSED = re.compile(r"(?P<at>[\d-]+T[\d:]+)\S* +WARN .*zenoh_link_tls\S* (?P<why>.*?)\. Hint: ")
_COLOUR = re.compile(r"\x1b\[\d+m")
REASONS = {
    "certificate expired": "its certificate has ended",
    "not valid yet": "its certificate does not hold yet: is a clock behind?",
    "BadSignature": "its certificate is of another authority",
    "UnknownIssuer": "its certificate is of another authority",
    "extended key usage": "its certificate is not for a client",
    "sent no certificates": "it has no certificate",
    "corrupt message": "it speaks no TLS",
    "SupportedVersionsExtensionRequired": "its TLS is older than 1.3",
    "fatal alert": "it does not take the router's certificate",
    "handshake eof": "it went away amid the handshake",
}
"""Words of the router's log (rustls), in the words of who reads them."""


def router(fleet: Target, now: Look) -> Iterator[Check]:
    """Whether the router lets this command line in, and each process that has no router; else why."""
    told = now.fleet
    if not isinstance(fleet, Local) or told is None or not any(status.pid for status in told.processes):
        return
    if why := _why(fleet, told, identity.CONSOLE, told.connect):
        yield Check(ROUTER, Level.WRONG, why, f"`roco agent restart {ROUTER}`; new keys: `roco down`, then `roco up`")
    else:
        yield Check(ROUTER, Level.FINE, f"listens at {told.connect}")
    for one in now.seen:
        keys = key_file(fleet.run / KEYS_FOLDER, one.name).is_file()
        if keys and _lacks(one) and (own := _why(fleet, told, one.name, told.connect)):
            yield Check(one.name, Level.WRONG, f"no router: {own}", f"see {one.name}.log of the run")


def _lacks(one: Seen) -> bool:
    """Whether a process lives and has no router, or had none yet."""
    return bool(one.status.pid) and one.name != ROUTER and (one.beat is None or not one.beat.up)


def _why(fleet: Local, told: Fleet, name: str, address: str) -> str:
    try:
        return why_not(address, identity.tls(fleet.run, told, name))
    except ConsoleError as error:  # keys are missing
        return str(error)


def refusals(fleet: Target, now: Look) -> Iterator[Check]:
    """Sessions that the router did not let in, by reason, as its log has them."""
    lines: list[str] = []
    with suppress(ConsoleError):  # unknown, or no container of it runs; told elsewhere
        lines += fleet.log(ROUTER, LINES)
    found = [match for line in lines if (match := _REFUSED.match(_COLOUR.sub("", line)))]
    if found:
        counted = Counter(reason(match["why"]) for match in found)
        words = "; ".join(f"{count} × {why}" for why, count in counted.most_common())
        last = max(match["at"] for match in found).replace("T", " ")
        what = f"{len(found)} sessions were refused, the last at {last} UTC: {words}"
        yield Check("refusals", Level.NOTE, what, "router.log has a line for each; who is refused: docs/security.md")


def reason(logged: str) -> str:
    """The router's word for a refusal in the words of who reads it; as it is, where it is none of those known."""
    return next((words for word, words in REASONS.items() if word in logged), logged)
