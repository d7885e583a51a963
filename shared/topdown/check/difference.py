"""Changes between two designs, for review: entry by entry in any order, and what follows from them.

Entries are told apart by kind and name. The order of arcs of a state (the first that holds is
taken), of steps and of table rows means something; all other order does not. Derived: groups and
channels as the steps end, and the rules (who may say what to whom), which are what access rights
and judges are made of.
"""

from collections.abc import Iterator
from enum import StrEnum
from typing import Any

import msgspec

from topdown.model.design import Design, Rule


class Way(StrEnum):
    """Kinds of change of an entry or a field."""

    ADDED = "added"
    REMOVED = "removed"
    CHANGED = "changed"


class Change(msgspec.Struct, frozen=True):
    """An entry `kind` `name` was added, removed, or changed in `field` from `old` to `new` (words,
    "" for nothing).

    `derived`: nobody wrote it, it follows from what was written.
    """

    way: Way
    kind: str
    name: str
    field: str = ""
    old: str = ""
    new: str = ""
    derived: bool = False


Entries = dict[tuple[str, str], dict[str, str]]
_NAMES = ("name", "id", "kind")
# entry -> its field of entries that are compared one by one, and what one of them is called
_NESTED = {
    "protocol": ("message", "message"),
    "interface": ("entries", "entry"),
    "agent": ("state", "state"),
    "step": ("channels", "new channel"),
}
# fields whose order means nothing
_UNORDERED = (
    "content talks interface writers readers recorders requirements evidence rest performatives"
    " protocols languages ontologies classes in agents groups confirmed ended urgent resting answer"
)
_SETS = frozenset(_UNORDERED.split())


def diff(old: Design, new: Design) -> tuple[Change, ...]:
    """All changes from `old` to `new`: what was written, then what follows."""
    written = _compare(_entries(old), _entries(new), derived=False)
    return (*written, *_compare(_derived(old), _derived(new), derived=True))


def _compare(old: Entries, new: Entries, *, derived: bool) -> Iterator[Change]:
    for key in dict.fromkeys((*old, *new)):
        kind, name = key
        if key not in new:
            yield Change(Way.REMOVED, kind, name, old=_short(old[key]), derived=derived)
        elif key not in old:
            yield Change(Way.ADDED, kind, name, new=_short(new[key]), derived=derived)
        else:
            for field in dict.fromkeys((*old[key], *new[key])):
                was, now = old[key].get(field, ""), new[key].get(field, "")
                if was != now:
                    yield Change(Way.CHANGED, kind, name, field, was, now, derived)


def _short(entry: dict[str, str]) -> str:
    return ", ".join(f"{field} {value}" for field, value in entry.items() if value)


def _entries(design: Design) -> Entries:
    """Everything that is written, by kind and name."""
    found: Entries = {}
    for kind, value in msgspec.json.decode(msgspec.json.encode(design.file)).items():
        if isinstance(value, dict):
            found[kind, ""] = {field: _value_text(some, field) for field, some in value.items()}
        if isinstance(value, int):
            found["file", ""] = {kind: str(value)}
        for number, entry in enumerate(value if isinstance(value, list) else [], start=1):
            name = next((str(entry[field]) for field in _NAMES if field in entry), str(number))
            _take(found, kind, name, entry)
    return found


def _take(found: Entries, kind: str, name: str, entry: dict[str, Any]) -> None:
    """An entry, with the entries inside it as entries of their own."""
    fields = dict(entry)
    if kind == "agent":
        fields |= {f"arcs of {state}": arcs for state, arcs in _arcs(fields.pop("arc")).items()}
        for row in fields.pop("row"):
            found["row", f"{name}: {_value_text(row)}"] = {}
    part, inner = _NESTED.get(kind, ("", ""))
    for one in fields.pop(part, []):
        _add(found, inner, name, one)
    found[kind, name] = _plain(fields)


def _add(found: Entries, kind: str, outer: str, entry: Any) -> None:
    """An entry inside another; several of the same name are told apart by a number."""
    name = first = f"{outer}: {_name(kind, entry)}"
    count = 1
    while (kind, name) in found:
        count += 1
        name = f"{first} ({count})"
    found[kind, name] = _plain(entry) if isinstance(entry, dict) else {"is": _value_text(entry)}


def _name(kind: str, entry: Any) -> str:
    if kind == "message":
        return f"{entry['sender']} {entry['performative']}"
    if kind == "entry":
        return str(entry[1])
    return next(str(entry[field]) for field in _NAMES if field in entry)


def _plain(entry: dict[str, Any]) -> dict[str, str]:
    return {name: _value_text(value, name) for name, value in entry.items() if name not in _NAMES}


def _arcs(arcs: list[dict[str, Any]]) -> dict[str, str]:
    """State -> its arcs, in the order in which they are tried."""
    found: dict[str, str] = {}
    for arc in arcs:
        words = f"{arc['target']}{' when ' + arc['when'] if arc['when'] else ''}"
        before = found.get(arc["source"])
        found[arc["source"]] = f"{before}, {words}" if before is not None else words
    return found


def _derived(design: Design) -> Entries:
    found: Entries = {}
    for channel in design.channels.values():
        ends, transmits = " and ".join(sorted(channel.ends)), "; ".join(channel.transmits)
        found["channel", channel.id] = {"ends": ends, "transmits": transmits}
    for group in design.decomposition.last.groups:
        found["group", group] = {"task": design.decomposition.tasks.get(group, "")}
    for rule in design.rules.values():
        name = f"{rule.sender} to {rule.receiver}: {rule.protocol} {rule.performative}"
        found["rule", name] = _rule(rule)
    return found


def _rule(rule: Rule) -> dict[str, str]:
    sizes = sorted(f"{name} {size} B" for name, size in rule.sizes.items())
    return {
        "channel": rule.channel,
        "language": rule.language,
        "ontology": rule.ontology,
        "contents": ", ".join(sizes),
        "bytes": str(rule.bytes),
        "durable": str(rule.durable).lower(),
        "latest": str(rule.latest).lower(),
    }


def _value_text(value: Any, field: str = "") -> str:
    """A value in words; what is a set in the file is put in order."""
    if isinstance(value, dict):
        said = {name: some for name, some in value.items() if some not in ("", [], None, False)}
        return ", ".join(f"{name} {_value_text(some, name)}" for name, some in said.items())
    if isinstance(value, list):
        listed = ((_value_text(some), isinstance(some, list)) for some in value)
        words = [f"[{text}]" if inner else text for text, inner in listed]
        return ", ".join(sorted(words) if field in _SETS else words)
    if isinstance(value, bool):
        return str(value).lower()
    return "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
