"""Structured logs: every event as one JSON line in a file, and what the level asks for as a short line on the console.

Each line has time, agent and event; lines about a conversation have its id.
"""

import logging
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any, TextIO

import msgspec


@contextmanager
def _without_rich() -> Iterator[None]:
    """structlog loads rich, where it is there, for tracebacks in colour: 0.14 s of each service's start, never used."""
    had = sys.modules.get("rich")
    sys.modules["rich"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules["rich"]
        if had is not None:
            sys.modules["rich"] = had


with _without_rich():
    import structlog

LEVELS = {"debug": logging.DEBUG, "info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}


class Log:
    """`file`: JSON lines are appended there, from debug on; `level`: the least that the console shows."""

    def __init__(
        self, agent: str, level: str = "info", file: Path | None = None, console: TextIO | None = None
    ) -> None:
        """Raises ValueError for an unknown level."""
        if level not in LEVELS:
            raise ValueError(f"log level {level!r} is none of {', '.join(LEVELS)}")
        self._agent = agent
        self._least = LEVELS[level]
        self._file: FileIO | None = None
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._file = FileIO(file, "a")
        self._short = _wrapped(console or sys.stdout, _short, agent)

    def show(self, level: str) -> None:
        """Set the least level that the console shows. Raises KeyError for an unknown one."""
        self._least = LEVELS[level]

    def write(self, event: str, level: str = "info", **fields: Any) -> None:
        """One line."""
        self.write_all([(time.time(), event, level, fields)])

    def write_all(self, lines: Sequence[tuple[float, str, str, dict[str, Any]]]) -> None:
        """Lines in one go: of each the time [unix s], the event, its level and its fields."""
        if self._file is not None:
            self._file.write(
                b"".join(
                    _encoder.encode({"agent": self._agent, "t": at, "level": level, **fields, "event": event}) + b"\n"
                    for at, event, level, fields in lines
                )
            )
        for at, event, level, fields in lines:
            if LEVELS.get(level, logging.ERROR) >= self._least:
                self._short.msg(event, t=at, level=level, **fields)

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None


_encoder = msgspec.json.Encoder(enc_hook=str)


def _wrapped(out: TextIO, renderer: Any, agent: str) -> Any:
    logger = structlog.wrap_logger(
        structlog.WriteLogger(out), processors=[renderer], wrapper_class=structlog.BoundLogger, context_class=dict
    )
    return logger.bind(agent=agent)


def _short(_: Any, __: str, line: dict[str, Any]) -> str:
    """`12:00:01.123 ta   sent  inform to co  co-1-4`: time, agent, event, the rest as words."""
    at = float(line.pop("t"))
    level, agent, event = line.pop("level"), line.pop("agent"), line.pop("event")
    conversation = line.pop("conversation", "")
    words = " ".join(f"{name}={value}" for name, value in line.items() if value not in ("", None))
    clock = time.strftime("%H:%M:%S", time.localtime(at)) + f".{int(at % 1 * 1000):03d}"
    mark = {"warning": "! ", "error": "!! "}.get(level, "")
    return " ".join(part for part in (clock, f"{agent:<6}", f"{mark}{event}", words, conversation) if part)
