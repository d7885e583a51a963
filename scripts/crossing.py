"""Traffic over the cable between the executor's host and the others, counted in a recording (for
scripts/two-hosts).

Everything of ex that somebody else hears, and everything that ex hears of others, crosses; nothing
else does.
"""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import House, Record, Spoken

FAR = "ex"
PAPER = 1 + 14 + 24
"""Table 8 of the paper: communicates from ta and km to ex, and from ex to km: what went between its
two machines.
"""
Row = tuple[str, int, int]


def crossed(run: Path) -> tuple[Row, ...]:
    """Return kind, count and bytes of what crossed, largest first. Copies that were sent again
    count again.
    """
    found: dict[str, list[int]] = defaultdict(list)
    for record in mcap_file.read(run / TRAFFIC_FILE).records:
        for what, size in _crossing(record):
            found[what].append(size)
    rows = [(what, len(sizes), sum(sizes)) for what, sizes in found.items()]
    return tuple(sorted(rows, key=lambda row: -row[2]))


def _crossing(record: Record) -> Iterator[tuple[str, int]]:
    match record:
        case Spoken() if FAR in (record.sender, record.receiver):
            yield f"{record.channel} {record.sender} > {record.receiver}", record.size
        case House() if FAR in (record.owner, record.peer):
            yield f"{record.kind} {record.owner} > {record.peer or 'all'}", len(record.data)


def told(report: dict, rows: tuple[Row, ...], carried: tuple[int, int]) -> str:
    """The end of it, in lines for a person. `carried`: bytes from and to the robot's host, with all
    headers.
    """
    poured = report.get("poured_fraction")
    said = sum(count for what, count, _ in rows if what.startswith("C"))
    why = report.get("failure") or "and no report; see desk/monitor.log"
    lines = [
        "success" if report.get("success") else f"no success: {why}",
        *([f"{100 * poured:.0f} % of the content is in the bowl"] if poured is not None else []),
        *(
            f"{hole['start']:.1f}-{hole['end']:.1f} s: {hole['text']}"
            for hole in report.get("holes", [])
        ),
        (
            f"over the cable: {carried[0] / 1e6:.1f} MB from the robot, {carried[1] / 1e6:.1f} MB"
            " to it, of this"
        ),
        *(f"  {what:<20} {count:6}  {size / 1000:9.1f} kB" for what, count, size in rows),
        f"communicates of ex with others: {said}; the paper has {PAPER} (Table 8)",
    ]
    return "\n".join(lines)
