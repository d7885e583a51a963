"""Judging afterwards: a run folder, a traffic.mcap or a live.jsonl, by this system's design or by another one's."""

import importlib
from pathlib import Path

import msgspec

from companion.design import DESIGN
from companion.languages import LANGUAGES
from fipa_codec.languages import Languages
from operate.judging import judged
from operate.recording import mcap_file
from operate.run_folder import LIVE_FILE, TRAFFIC_FILE, Judged, LiveLine
from topdown.model import design
from topdown.model.errors import TopdownError


class CannotJudge(Exception):
    """There is nothing to judge, or nothing to judge by; it says what would be right."""


def judge(file: Path, by: Path | None = None, languages: str = "") -> tuple[Judged, ...]:
    """Every verdict about what `file` holds, in the order of time.

    `by`: another system's design file; `languages`: where its `Languages` are, "package.module:NAME", else its contents
    are not read. Raises CannotJudge.
    """
    if file.is_dir():
        file = next((one for one in (file / TRAFFIC_FILE, file / LIVE_FILE) if one.exists()), file / TRAFFIC_FILE)
    if not file.is_file():
        raise CannotJudge(f"{file} is not there; give a run folder, a {TRAFFIC_FILE} or a {LIVE_FILE}")
    used = DESIGN if by is None else _design(by)
    if file.suffix == ".jsonl":
        return judged.of_live(_live(file), used)
    records = mcap_file.read(file).records
    if not records:
        raise CannotJudge(f"{file} holds no record that can be read; give a {TRAFFIC_FILE} of a run")
    spoken = _languages(languages) if languages else LANGUAGES if by is None else None
    return judged.of_records(records, used, spoken)


def _design(path: Path) -> design.Design:
    try:
        return design.load(path)
    except (TopdownError, OSError) as error:
        raise CannotJudge(str(error)) from error


def _languages(place: str) -> Languages:
    module, _, name = place.partition(":")
    try:
        found = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise CannotJudge(f"no languages at {place!r} ({error}); write package.module:NAME") from error
    if not isinstance(found, Languages):
        raise CannotJudge(f"{place} is {type(found).__name__}; give a fipa_codec.languages.Languages")
    return found


def _live(file: Path) -> list[LiveLine]:
    """Lines of kinds or with fields of another version are left out, as a reader of that file should."""
    lines: list[LiveLine] = []
    decoder = msgspec.json.Decoder(LiveLine)
    for raw in file.read_bytes().splitlines():
        try:
            lines.append(decoder.decode(raw))
        except msgspec.DecodeError:
            continue
    return lines
