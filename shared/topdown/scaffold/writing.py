"""Writes a project's files and never overwrites one that was changed since.

`.scaffold.json` remembers what was written.
The only files this touches are those it is given and that one.
"""

import ast
import hashlib
import re
from pathlib import Path

import msgspec

MANIFEST = ".scaffold.json"


class Kept(msgspec.Struct, frozen=True):
    """A file that somebody changed and that was not touched; `missing`: names that no own file
    mentions.
    """

    path: str
    missing: tuple[str, ...] = ()


class Outcome(msgspec.Struct, frozen=True):
    """Paths relative to `folder`: `written` (new or changed), `same` as they were, `kept`; `left`:
    no longer made.
    """

    folder: str
    written: tuple[str, ...]
    same: tuple[str, ...]
    kept: tuple[Kept, ...]
    left: tuple[str, ...]


def write(folder: Path, files: dict[str, str]) -> Outcome:
    """Write what is new, rewrite what nobody touched, keep the rest. Raises OSError."""
    try:
        known = msgspec.json.decode((folder / MANIFEST).read_bytes(), type=dict[str, str])
    except (OSError, msgspec.MsgspecError):
        known = {}
    written: list[str] = []
    same: list[str] = []
    kept: list[str] = []
    for path, text in files.items():
        target = folder / path
        present = target.read_text(encoding="utf-8") if target.exists() else None
        if present == text:
            same.append(path)
        elif present is None or known.get(path) == _sum(present):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
            written.append(path)
        else:
            kept.append(path)
            continue
        known[path] = _sum(text)
    left = tuple(path for path in known if path not in files and (folder / path).exists())
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MANIFEST).write_bytes(
        msgspec.json.format(msgspec.json.encode(known), indent=1) + b"\n"
    )
    made = files.keys() - kept
    # all Python that a user wrote: what is bound in one of these files may be defined in another
    others = (
        [path for path in folder.rglob("*.py") if path.relative_to(folder).as_posix() not in made]
        if kept
        else []
    )
    own = "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in others)
    changed = tuple(
        Kept(path, missing(files[path], own) if path.endswith(".py") else ()) for path in kept
    )
    return Outcome(str(folder), tuple(written), tuple(same), changed, left)


def missing(wanted: str, present: str) -> tuple[str, ...]:
    """Functions, classes and tables that `wanted` defines and `present` does not so much as
    mention.
    """
    words = set(re.findall(r"\w+", present))
    return tuple(name for name in _defined(wanted) if name not in words)


def _defined(text: str) -> list[str]:
    names = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign):
            names += [target.id for target in node.targets if isinstance(target, ast.Name)]
    return names


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
