"""The keys of a whole fleet, from its design: who gets which certificate, where, and the rules of router and agents.

All in one folder where everybody runs as one user; `apart`, a folder for each identity, where each process sees only
its own (containers). Several systems may stand behind one router: then each system has a folder, and the certificates
in it name the system. What is there and still holds for `keep_days` may be kept: a new authority separates agents with
its keys from those with the old ones.
"""

import datetime as dt
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
from cryptography import x509
from cryptography.x509.oid import NameOID

from agent_runtime.io import keys
from agent_runtime.io.run_files import write_secret
from agent_runtime.io.secured import (
    AUTHORITY,
    LINKS,
    REVOKED,
    RIGHTS,
    ROUTER,
    KeysError,
    Rights,
    certificate_file,
    key_file,
    links_file,
    revoked,
    rights_of,
)
from topdown.model.design import Design
from topdown.model.rights import access_control, common_names, links_control

OWNER_ONLY = 0o700


class Seat(msgspec.Struct, frozen=True):
    """Place of an identity's keys: files of `identity` in `folder`, in a certificate with the common name `name`."""

    identity: str
    name: str
    folder: Path


class Issued(msgspec.Struct, frozen=True):
    """A folder of keys. `until`: end of their validity (UTC); `made_now`: whether they were made, not kept."""

    folder: str
    systems: tuple[str, ...]
    identities: tuple[str, ...]
    until: dt.datetime
    made_now: bool


def seats(
    folder: Path,
    design: Design,
    systems: Sequence[str],
    *,
    apart: bool = False,
) -> tuple[Seat, ...]:
    """Return the folder of each certificate."""
    found = []
    for name, pairs in common_names(design, systems).items():
        identity, system = pairs[0]
        where = folder if name == identity else folder / system
        found.append(Seat(identity, name, where / identity if apart else where))
    return tuple(found)


def issue(
    folder: Path,
    design: Design,
    systems: Sequence[str],
    *,
    days: float = keys.DAYS,
    hosts: Sequence[str] = keys.HOSTS,
    apart: bool = False,
    keep_days: float | None = None,
    now: dt.datetime | None = None,
) -> Issued:
    """Make all keys of the systems, or keep what still holds for `keep_days`. Raises OSError."""
    begin = now or dt.datetime.now(dt.UTC)
    places = seats(folder, design, systems, apart=apart)
    rights = Rights(tuple(systems), access_control(design, *systems))
    links = _links(design, systems)
    until = None if keep_days is None else holding(places, rights, hosts, links)
    kept = until is not None and keep_days is not None and until >= begin + dt.timedelta(days=keep_days)
    if until is None or not kept:
        until = _make(folder, places, rights, begin, days, hosts, links)
    return Issued(str(folder), rights.systems, tuple(seat.name for seat in places), until, not kept)


def _links(design: Design, systems: Sequence[str]) -> dict[str, Rights]:
    """Return each agent's rules for its neighbours, by its common name."""
    found = {}
    for system in systems:
        names = {
            who: name for name, pairs in common_names(design, systems).items() for who, of in pairs if of == system
        }
        for agent in design.agents:
            found[names[agent]] = Rights((system,), links_control(design, system, agent, names))
    return found


def _make(
    folder: Path,
    places: Sequence[Seat],
    rights: Rights,
    begin: dt.datetime,
    days: float,
    hosts: Sequence[str],
    links: dict[str, Rights],
) -> dt.datetime:
    end = begin + dt.timedelta(days=days)
    issuer = keys.authority(f"{' '.join(rights.systems)} authority"[:64], begin, end)
    routed = {seat.folder for seat in places if seat.identity == ROUTER}
    for where in (folder, *dict.fromkeys(seat.folder for seat in places)):
        where.mkdir(parents=True, exist_ok=True)
        if stat.S_IMODE(where.stat().st_mode) != OWNER_ONLY:  # a mount point may be on a disk that is read only
            where.chmod(OWNER_ONLY)
    for seat in sorted(places, key=lambda one: one.identity == ROUTER):  # the router's last: it looks for new ones
        routes = seat.identity == ROUTER
        if routes or (seat.name in links and seat.folder not in routed):
            # The revoked keys are of an authority that was replaced.
            (seat.folder / REVOKED).unlink(missing_ok=True)
        keys.publish(seat.folder, issuer, rights if routes else None)
        listening = hosts if routes or seat.name in links else ()
        if seat.name in links:
            write_secret(links_file(seat.folder, seat.identity), msgspec.json.encode(links[seat.name]))
        keys.issue(seat.folder, issuer, seat.identity, begin, end, listening, name=seat.name, joins=seat.name in links)
    return end


def revoke(folder: Path, name: str, *, undo: bool = False) -> tuple[str, ...]:
    """Deny the common name every right at each router and agent whose keys lie in the folder.

    Return all that are denied. Raise KeysError where no router's keys are there, or it knows no such name. `undo`:
    grant them again.
    """
    routers = sorted(file.parent for file in folder.rglob(RIGHTS))
    if not routers:
        raise KeysError(f"no {RIGHTS} in {folder} or below; give the folder that `roco keys make` wrote")
    known = {one["id"] for where in routers for one in rights_of(where).access_control["subjects"]}
    if name not in known:
        raise KeysError(f"no certificate is named {name!r}; there are {', '.join(sorted(known))}")
    now: set[str] = set()
    for where in sorted({*routers, *(file.parent for file in folder.rglob(f"*{LINKS}"))}):
        denied = set(revoked(where)) - {name} if undo else {*revoked(where), name}
        write_secret(where / REVOKED, msgspec.json.encode(sorted(denied)))
        now |= denied
    return tuple(sorted(now))


def holding(
    places: Sequence[Seat], rights: Rights, hosts: Sequence[str], links: Mapping[str, Rights]
) -> dt.datetime | None:
    """Until when all that is there holds; None where something lacks, or is of another authority, system or design, or
    where key identifiers lack, as in certificates of older versions, which Python 3.13 refuses.

    `links`: the agents' rules, by common name.
    """
    try:
        authorities = {(seat.folder / AUTHORITY).read_bytes() for seat in places}
        found = [(seat, _certificate(certificate_file(seat.folder, seat.identity))) for seat in places]
        there = all(key_file(seat.folder, seat.identity).is_file() for seat in places)
        routers = [seat.folder for seat in places if seat.identity == ROUTER]
        wanted = msgspec.json.decode(msgspec.json.encode(rights), type=Rights)
        same = all(rights_of(where, *rights.systems) == wanted for where in routers)
        for seat in (one for one in places if one.name in links):
            rules = links_file(seat.folder, seat.identity).read_bytes()
            same = same and rules == msgspec.json.encode(links[seat.name])
        (issuer,) = map(x509.load_pem_x509_certificate, authorities)
        signed = all(_signed(one, issuer) and _named(one) == seat.name for seat, one in found)
        identified = all(_identified(one) for one in (issuer, *(certificate for _, certificate in found)))
        listening = (one for seat, one in found if seat.identity == ROUTER or seat.name in links)
        listens = all(_listens(one, hosts) for one in listening)
    except (OSError, ValueError, KeysError):
        return None
    if not (there and same and signed and identified and listens):
        return None
    return min(one.not_valid_after_utc for one in (issuer, *(certificate for _, certificate in found)))


def lifetime(file: Path) -> tuple[dt.datetime, dt.datetime]:
    """From when until when a certificate holds. Raises OSError, or ValueError where it is none."""
    found = _certificate(file)
    return found.not_valid_before_utc, found.not_valid_after_utc


def _certificate(file: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(file.read_bytes())


def _signed(certificate: x509.Certificate, issuer: x509.Certificate) -> bool:
    try:
        certificate.verify_directly_issued_by(issuer)
    except Exception:  # cryptography raises InvalidSignature, ValueError or TypeError: it is not of this authority
        return False
    return True


def _identified(certificate: x509.Certificate) -> bool:
    there = {type(extension.value) for extension in certificate.extensions}
    return there >= {x509.SubjectKeyIdentifier, x509.AuthorityKeyIdentifier}


def _named(certificate: x509.Certificate) -> object:
    return certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value


def _listens(certificate: x509.Certificate, hosts: Sequence[str]) -> bool:
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:  # it was made for one that only dials
        return False
    return all(keys.host(name) in names for name in hosts)
