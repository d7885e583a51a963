"""Cost of our layers: a question and its answer as shipped and in parts, the codec, a step of a
conversation.

    python benchmarks/as_shipped.py [--quick] [--only codec|conversation|trip] [--out results file]

Each row sets ours against the bare thing, by turns in blocks, so that noise hits both alike; ratios
are those of the medians and of the 99th percentiles, each with the 95 % interval of 500 samples of
its blocks. A row is appended to the results file with the commit and the machine's load before and
while it was measured; rows of this commit that stand there are skipped (--again measures them once
more). cyclictest runs beside the questions, where it is installed (Debian: rt-tests): how late a
bare thread was meanwhile. A full run takes some minutes.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import realtime
import tables
import typer
from fleets import KINDS, Fleet
from round_trip import WM

from companion.languages import wm
from companion.languages.facts import Kind, fact
from fipa_codec.communicate import _LETTERS, LABEL, WORD, Communicate, decode, encode
from fipa_codec.conversation import Conversation
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role

HERE = Path(__file__).parent
STEP_LIMIT_US, CODEC_LIMIT = 10.0, 1.3
TRIPS = {"654 B": (100, 41), "98 kB": (30, 21), "852 kB": (20, 21)}
"""Answer -> questions of a block, blocks of each fleet: eight of 852 kB begin cold."""
SAMPLES = 500  # of the blocks, for an interval
SIZES = {"231 B": 231, "654 B": 654, "98 kB": 98_000, "852 kB": 852_000}
"""Smallest, mean and largest of C4 and largest of all communicates (paper, section 5.7)."""


class Result(msgspec.Struct, omit_defaults=True):
    """One row: p50 and p99 [us] of ours and of the bare thing, and their ratios with 95 %
    intervals.

    `cyclictest_us`: least, mean and largest delay of a bare thread meanwhile. `cpu_ms`: processor
    time of all processes for each question, ours and the bare thing's, until the fleet was at rest
    again. `spread`: quartiles of the blocks' ratios, in rows until 2026-11-26.
    """

    run: str
    what: str
    ours_us: tuple[float, float]
    bare_us: tuple[float, float] | None = None
    ratio: float | None = None
    limit: float | None = None
    interval: tuple[float, float] | None = None
    p99_ratio: float | None = None
    p99_interval: tuple[float, float] | None = None
    cyclictest_us: dict[str, int] | None = None
    cpu_ms: tuple[float, float] | None = None
    spread: tuple[float, ...] = ()
    n: int = 0
    load: tuple[float, ...] = ()
    load_before: tuple[float, ...] = ()
    at: float = 0.0


def plain() -> Any:
    """The same fields with the same names on the wire, and no check but of types."""
    text = {
        "language",
        "ontology",
        "protocol",
        "reply_with",
        "in_reply_to",
        "conversation",
        "sender",
        "receiver",
        "id",
    }
    fields = msgspec.structs.fields(Communicate)
    kinds = {"reply_by": float | None, "sent": float}
    parts = [
        (f.name, str if f.name in text else kinds.get(f.name, f.type), f.default) for f in fields
    ]
    return msgspec.defstruct(
        "Plain", parts, kw_only=True, omit_defaults=True, frozen=True, rename=_LETTERS
    )


def patterned() -> Any:
    """The same fields, of which msgspec checks every character by our patterns."""
    words = {"language", "ontology", "protocol", "sender", "receiver"}
    labels = {"reply_with", "in_reply_to", "conversation", "id"}
    kinds = dict.fromkeys(words, Annotated[str, msgspec.Meta(pattern=rf"\A{WORD}\Z")])
    kinds |= dict.fromkeys(labels, Annotated[str, msgspec.Meta(pattern=rf"\A{LABEL}\Z")])
    parts = [
        (f.name, kinds.get(f.name, f.type), f.default) for f in msgspec.structs.fields(Communicate)
    ]
    return msgspec.defstruct(
        "Patterned", parts, kw_only=True, omit_defaults=True, frozen=True, rename=_LETTERS
    )


def many(size: int) -> list[Communicate]:
    """Answers as they come one after the other: each with ids of its own, `size` bytes long."""
    made = []
    for number in range(1000, 1200):
        usual = Communicate(
            performative=Performative.INFORM_REF,
            language="WM",
            ontology="RoCo",
            protocol="query",
            in_reply_to=f"pl-1-{number}",
            conversation=f"pl-1-{number - 1}",
            sender="km",
            receiver="pl",
            id=f"km-1-{number}",
            sent=1.76e9 + number,
        )
        room = max(0, size - len(encode(usual)) - 70)
        filler = fact(Kind.SEEN, *["x" * 62] * (room // 64), "x" * (room % 64))
        made.append(msgspec.structs.replace(usual, content=WM.encode(wm.Unknown((filler,)))))
    return made if size < 10_000 else made[:8]


def codec(quick: bool) -> list[Result]:
    """encode + decode against msgspec alone: without checks, and with the same checks left to
    msgspec.
    """
    rows, bare = [], plain()
    pack = msgspec.msgpack.Encoder().encode
    for name, size in SIZES.items():
        ours = many(size)
        others = [
            msgspec.convert(msgspec.to_builtins(one, builtin_types=(msgspec.Raw,)), bare)
            for one in ours
        ]
        for label, kind in (("unchecked", bare), ("its own patterns", patterned())):
            read = msgspec.msgpack.Decoder(kind).decode
            rounds = 20 if quick else 200
            mine, its = by_turns(
                lambda one: decode(encode(one)),
                ours,
                lambda one, read=read: read(pack(one)),
                others,
                rounds,
            )
            limit = CODEC_LIMIT if label == "unchecked" else None
            rows.append(
                result(f"encode + decode of {name} against msgspec, {label}", mine, its, limit)
            )
    return rows


def by_turns(
    ours: Callable[[Any], Any],
    mine: list[Any],
    bare: Callable[[Any], Any],
    its: list[Any],
    rounds: int,
) -> tuple[list[list[float]], list[list[float]]]:
    """Time of a call [us], the mean over one pass of the list, by turns."""
    taken: tuple[list[list[float]], list[list[float]]] = ([], [])
    for _ in range(rounds):
        for place, work, given in ((0, ours, mine), (1, bare, its)):
            begin = time.perf_counter_ns()
            for one in given:
                work(one)
            taken[place].append([(time.perf_counter_ns() - begin) / 1000 / len(given)])
    return taken


def conversation(quick: bool) -> list[Result]:
    """A step of a conversation: what it takes, and what it says."""
    said: list[tuple[str, Callable[[], Any]]] = []

    def exchange(protocol: str, *acts: Performative) -> None:
        asking = Conversation.open(protocol, Role.INITIATOR, id="pl-1-1", me="pl", peer="km")
        answering: Conversation | None = None
        for number, act in enumerate(acts):
            sender = asking if number == 0 or answering is None else answering
            say = partial(sender.send, act, id=f"x-1-{number}", now=1.0)
            after, message = say()
            hears = asking if number else Conversation.answering(message, "km")
            take = partial(hears.receive, message)
            said.append((f"{protocol}: send {act}", say))
            said.append((f"{protocol}: receive {act}", take))
            asking, answering = (take(), after) if number else (after, take())

    exchange("query", Performative.QUERY_REF, Performative.INFORM_REF)
    exchange("request", Performative.REQUEST, Performative.AGREE, Performative.INFORM)
    exchange("subscribe", Performative.SUBSCRIBE, Performative.AGREE, Performative.INFORM)
    rows = []
    for what, step in said:
        times = [[timed(step)] for _ in range(2_000 if quick else 20_000)]
        rows.append(result(what, times, None, STEP_LIMIT_US))
    return rows


def timed(work: Callable[[], Any]) -> float:
    """Of one call [us]."""
    begin = time.perf_counter_ns()
    work()
    return (time.perf_counter_ns() - begin) / 1000


def trip(quick: bool, wanted: list[str]) -> list[Result]:
    """query-ref -> inform-ref between two agents of each kind of fleet against a bare get; see
    fleets.py.
    """
    before = os.getloadavg()
    rows = []
    with tempfile.TemporaryDirectory(prefix="as-shipped-") as folder, ExitStack() as stack:
        late = stack.enter_context(beside(Path(folder) / "cyclictest"))
        fleets = {}
        for kind in KINDS:
            fleets[kind] = Fleet(Path(folder) / kind.name.replace(" ", "-"), kind)
            stack.callback(fleets[kind].end)
        for answer in wanted:
            (bare, spent), *others = turns(list(fleets.values()), answer, quick)
            for kind, (times, ours) in zip(KINDS[1:], others, strict=True):
                row = result(asked(answer, kind.name), times, bare, None)
                rows.append(msgspec.structs.replace(row, cpu_ms=(ours, spent)))
    return [
        msgspec.structs.replace(row, load_before=before, cyclictest_us=late or None) for row in rows
    ]


@contextmanager
def beside(path: Path) -> Iterator[dict[str, int]]:
    """Run cyclictest during the block; what is yielded gets its figures at the end, none where it
    is not installed.
    """
    figures: dict[str, int] = {}
    if shutil.which("cyclictest") is None:
        typer.echo("cyclictest is not installed: its figures are left out", err=True)
        yield figures
        return
    process = realtime.bare(path)
    try:
        yield figures
    finally:
        process.terminate()
        process.wait(timeout=10)
        figures |= realtime.figures(path) or {}


def asked(answer: str, kind: str) -> str:
    """Return the name of a question's row."""
    return f"question and answer of {answer}, {kind}"


def turns(fleets: list[Fleet], answer: str, quick: bool) -> list[tuple[list[list[float]], float]]:
    """Blocks of each, by turns, and the processor time that a question took [ms]."""
    count, blocks = TRIPS[answer]
    for fleet in fleets:
        fleet.block(answer, 3 * count)
        fleet.rest()
    turns = blocks // 5 if quick else blocks
    taken: list[list[list[float]]] = [[] for _ in fleets]
    spent = [0] * len(fleets)
    for _ in range(turns):
        for place, fleet in enumerate(fleets):
            before = fleet.ticks()
            taken[place].append(fleet.block(answer, count))
            fleet.rest()
            spent[place] += fleet.ticks() - before
    return [
        (times, round(10 * one / (turns * count), 2))
        for times, one in zip(taken, spent, strict=True)
    ]


def result(
    what: str, ours: list[list[float]], bare: list[list[float]] | None, limit: float | None
) -> Result:
    """A row from blocks of times [us]."""
    mine = sorted(one for block in ours for one in block)
    row = Result(
        RUN,
        what,
        middle_and_end(mine),
        limit=limit,
        n=len(mine),
        load=os.getloadavg(),
        at=time.time(),
    )
    if bare is not None:
        row.bare_us = middle_and_end(sorted(one for block in bare for one in block))
        row.ratio, row.p99_ratio = (
            round(a / b, 3) for a, b in zip(row.ours_us, row.bare_us, strict=True)
        )
        row.interval, row.p99_interval = intervals(ours, bare)
    return row


def intervals(
    ours: list[list[float]], bare: list[list[float]]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the 95 % intervals of the ratios of p50 and of p99, by drawing pairs of blocks
    again.
    """
    rng, mine, its = np.random.default_rng(1), np.array(ours), np.array(bare)
    drawn = rng.integers(0, len(mine), (SAMPLES, len(mine)))
    ratios = [
        np.percentile(mine[some], (50, 99)) / np.percentile(its[some], (50, 99)) for some in drawn
    ]
    low, high = np.percentile(ratios, (2.5, 97.5), axis=0).round(3)
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))


def middle_and_end(times: list[float]) -> tuple[float, float]:
    """p50 and p99 of sorted times."""
    return round(times[len(times) // 2], 2), round(
        times[min(len(times) - 1, len(times) * 99 // 100)], 2
    )


def shown(row: Result) -> str:
    """A row as people read it."""
    measure = row.ours_us[0] if row.ratio is None else row.ratio
    limit = (
        ""
        if row.limit is None
        else f"at most {row.limit:g}: {'yes' if measure <= row.limit else 'NO'}"
    )
    ours = f"{row.ours_us[0]:9.1f} {row.ours_us[1]:9.1f}"
    bare = f"{row.bare_us[0]:9.1f} {row.bare_us[1]:9.1f}" if row.bare_us else " " * 19
    cpu = "" if row.cpu_ms is None else f"cpu {row.cpu_ms[0]:.2f} {row.cpu_ms[1]:.2f} ms"
    ratios = f"{both(row.ratio, row.interval)} {both(row.p99_ratio, row.p99_interval)}"
    return f"{row.what:62} {ours} {bare}  {ratios} {limit}{cpu}"


def both(ratio: float | None, interval: tuple[float, float] | None) -> str:
    """A ratio with its interval."""
    return (
        " " * 19
        if ratio is None or interval is None
        else f"{ratio:6.2f} ({interval[0]:.2f}-{interval[1]:.2f})".ljust(19)
    )


RUN = tables.commit()


def main(
    quick: Annotated[
        bool, typer.Option("--quick", help="a tenth of the calls; nothing is written down")
    ] = False,
    only: Annotated[str, typer.Option(help="codec, conversation or trip")] = "",
    again: Annotated[
        bool, typer.Option("--again", help="also what stands in the results file for this commit")
    ] = False,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = HERE
    / "results"
    / "as_shipped.jsonl",
) -> None:
    """Measure, print a table (us: p50 p99 ours, p50 p99 bare, ratios of p50 and p99 with 95 %
    intervals), append.
    """
    lines = out.read_bytes().splitlines() if out.exists() and not (again or quick) else []
    known = {
        row.what
        for row in (msgspec.json.decode(line, type=Result) for line in lines)
        if row.run == RUN
    }
    wanted = [
        name for name in TRIPS if any(asked(name, kind.name) not in known for kind in KINDS[1:])
    ]
    parts: dict[str, Callable[[], list[Result]]] = {
        "codec": lambda: codec(quick),
        "conversation": lambda: conversation(quick),
        "trip": lambda: trip(quick, wanted) if wanted else [],
    }
    if only and only not in parts:
        raise typer.BadParameter(f"--only {only}: there are {', '.join(parts)}")
    typer.echo(
        f"{'commit ' + RUN:62} {'ours p50':>9} {'p99 us':>9} {'bare p50':>9} {'p99 us':>9}  ratio"
        " of p50, p99 (95 %)"
    )
    for part in [only] if only else list(parts):
        typer.echo(f"{part} ...", err=True)
        for row in parts[part]():
            if row.what in known:
                continue
            typer.echo(shown(row))
            if not quick:
                tables.append(out, row)
    typer.echo(
        f"load of the machine at the end: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    )


if __name__ == "__main__":
    typer.run(main)
