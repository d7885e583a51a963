"""Time the judge needs for a communicate of a real run, beside the cost of decoding it.

    python benchmarks/judging.py [--rounds N] [RECORDING]

Each round judges the whole recording with a new judge (a run folder or traffic.mcap; else the recorded pour of the
tests). Prints median and 99th percentile in microseconds of processor time over all communicates of all rounds, per
channel too, of: decode (bytes to communicate), decode and read (its content too), judge (both of them included, bytes
to verdict); the ratio of the last two in this run; and how many of each verdict. The aim is a median of at most 50 us.
"""

import argparse
import statistics
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

from companion.all_languages import LANGUAGES
from companion.design import DESIGN
from fipa_codec.communicate import decode
from operate.recording import mcap_file
from operate.recording.records import Record, Spoken, Token
from topdown.judge.judge import Judge

POUR = Path(__file__).parents[1] / "tests" / "histories" / "pour_seed_7" / "traffic.mcap"
Times = dict[str, list[float]]


def timed(call: Callable[[], object]) -> tuple[float, object]:
    """Seconds of processor and result."""
    began = time.thread_time()
    result = call()
    return time.thread_time() - began, result


def judge(records: tuple[Record, ...], times: Times, verdicts: Counter[str]) -> None:
    """One round of judging."""
    judge = Judge(DESIGN, LANGUAGES)
    for record in records:
        if isinstance(record, Token) and record.alive:
            judge.lived(record.agent, record.incarnation, record.received, fresh=True)
        elif isinstance(record, Spoken):
            key = DESIGN.key("roco", record.communicate)
            took, found = timed(lambda: judge.hear(key, record.wire, record.received))  # noqa: B023
            times[record.channel].append(took)
            verdicts.update(one.verdict for one in found)  # type: ignore[attr-defined]
    verdicts.update(one.verdict for one in judge.finish(records[-1].received))


def read(records: tuple[Record, ...], decoding: list[float], reading: list[float]) -> None:
    """One round of decoding alone."""
    for record in records:
        if isinstance(record, Spoken):
            took, communicate = timed(lambda: decode(record.wire))  # noqa: B023
            decoding.append(took)
            reading.append(took + timed(lambda: LANGUAGES.read(communicate))[0])  # type: ignore[arg-type] # noqa: B023


def row(name: str, seconds: list[float]) -> str:
    """Median and 99th percentile."""
    us = [1e6 * one for one in seconds]
    return f"{name:24} {statistics.median(us):8.1f} {statistics.quantiles(us, n=100)[98]:8.1f} {len(us):9}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path, nargs="?", default=POUR)
    parser.add_argument("--rounds", type=int, default=20)
    options = parser.parse_args()
    file = options.recording / mcap_file.FILE if options.recording.is_dir() else options.recording
    records = mcap_file.read(file).records
    times: Times = defaultdict(list)
    decoding: list[float] = []
    reading: list[float] = []
    verdicts: Counter[str] = Counter()
    for _ in range(options.rounds):
        judge(records, times, verdicts)
        read(records, decoding, reading)
    judged = [one for channel in times.values() for one in channel]
    print(f"{'':24} {'median':>8} {'p99 [us]':>8} {'count':>9}")
    print(row("decode", decoding), row("decode and read", reading), row("judge", judged), sep="\n")
    for channel in sorted(times):
        print(row(f"  judge, {channel}", times[channel]))
    ratio = statistics.median(judged) / statistics.median(reading)
    print(f"judge / (decode and read), medians: {ratio:.1f}")
    print(", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common()), f"in {options.rounds} rounds")


if __name__ == "__main__":
    main()
