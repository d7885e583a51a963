"""First difference in the output of an agent's step that is run again: the field, its old value, its new value.

The log keeps a hash of a step's output. The journal has the records of the last life, the recording what was sent
and receipted: what of it gives that hash again is what the step put out. Pure.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise, product
from typing import Any, cast

import msgspec

from agent_runtime.core.effects import Effects, Receipt
from agent_runtime.io.step_replay import Parted, Put
from agent_runtime.io.steplog import fingerprint
from fipa_codec.communicate import Communicate, decode
from operate.cli.traffic.script import difference


class Difference(msgspec.Struct, frozen=True):
    """The first step of an agent whose output differs, and in what: a field, its recorded value, its value now.

    `life`, `step`: which, by the agent's own count; `at`: when it was made [unix s]; `kind`: the event's class.
    """

    life: int
    step: int
    at: float
    kind: str
    field: str
    recorded: Any
    now: Any


class Kept(msgspec.Struct, frozen=True):
    """Stored evidence of an agent: its journal's records, and its communicates and receipts in the recording near the
    step.
    """

    journal: Sequence[bytes] = ()
    said: Sequence[Communicate] = ()
    receipts: Sequence[Receipt] = ()


def first(parted: Parted, kept: Kept) -> Difference:
    """Name it. Where what was put out is kept nowhere (`tells`: to devices), `recorded` is the hash of the output."""
    field, recorded, now = _named(parted, kept)
    return Difference(parted.incarnation, parted.step, parted.at, parted.kind, field, recorded, now)


def _named(parted: Parted, kept: Kept) -> tuple[str, Any, Any]:
    put = parted.now
    if put is None:
        return "error", None, parted.error
    found = difference(_told(parted.deed), _told(put.deed), "deed")
    if found is not None:
        return found
    now = _effects(put)
    for then in _possible(parted, now, kept):
        if fingerprint(then) == parted.output:
            return _between(then, now)
    words = _worded_all(now.sends), _worded_all(next(_sent(parted.at, now.sends, kept.said)))
    found = difference(words[1], words[0], "sends")
    if found is not None:
        return found
    whole = kept.said and parted.before in kept.journal
    field, value = ("tells", _told(now.tells)) if whole else ("output", _plain(now))
    return field, f"hash {parted.output.hex()}", value


def _effects(put: Put) -> Effects:
    """Return the present output of a step, as it is hashed."""
    tells = cast(tuple[Any, ...], msgspec.Raw(put.tells))
    return Effects(put.record, put.receipts, tuple(map(decode, put.sends)), tells)


def _possible(parted: Parted, now: Effects, kept: Kept) -> Iterator[Effects]:
    """Yield the outputs that the step may have had, the likeliest first: each part as it is now, or as stored."""
    records = (now.record, *_after(parted.before, kept.journal), None)
    sends = (now.sends, *_sent(parted.at, now.sends, kept.said))
    receipts = (now.receipts, *_receipted(now.receipts, kept.receipts))
    for record, words, receipted, told in product(records, sends, receipts, (now.tells, ())):
        yield Effects(record, receipted, words, told)


def _after(before: bytes, journal: Sequence[bytes]) -> Iterable[bytes]:
    """The record that follows the one that was written last before the step; all where that one is another now."""
    return [later for one, later in pairwise(journal) if one == before][-1:] if before in journal else journal


def _sent(at: float, now: tuple[Communicate, ...], said: Sequence[Communicate]) -> Iterator[tuple[Communicate, ...]]:
    """The same communicates as they were heard, with and without those that only one side has."""
    heard = {(one.receiver, one.id): one for one in said}
    then = [heard.get((one.receiver, one.id)) for one in now]
    mine = {(one.receiver, one.id) for one in now}
    more = [one for name, one in heard.items() if one.sent == at and name not in mine]
    both = tuple(one for one in then if one is not None)
    yield tuple(was or one for was, one in zip(then, now, strict=True))
    yield (*both, *more)
    yield both


def _receipted(now: tuple[Receipt, ...], then: Sequence[Receipt]) -> Iterator[tuple[Receipt, ...]]:
    """No receipt, or another one to the same peer, or one where there is none now."""
    yield ()
    for one in then:
        yield (*(other for other in now if other.peer != one.peer), one)


def _between(then: Effects, now: Effects) -> tuple[str, Any, Any]:
    """The first field in which two outputs differ."""
    was, is_now = _plain(then), _plain(now)
    found = difference(was, is_now)
    return found or ("record", then.record, now.record)  # the same values in other bytes: another order


def _plain(effects: Effects) -> dict[str, Any]:
    return {
        "record": None if effects.record is None else msgspec.msgpack.decode(effects.record),
        "sends": _worded_all(effects.sends),
        "receipts": _told(effects.receipts),
        "tells": _told(effects.tells),
    }


def _told(value: Any) -> Any:
    return msgspec.msgpack.decode(msgspec.msgpack.encode(value))


def _worded_all(sends: Iterable[Communicate]) -> list[dict[str, Any]]:
    return [_worded(one) for one in sends]


def _worded(one: Communicate) -> dict[str, Any]:
    told = {name: getattr(one, name) for name in one.__struct_fields__ if name != "content"}
    return told if one.content is msgspec.UNSET else told | {"content": msgspec.msgpack.decode(one.content)}
