"""From a run folder to its report: report.json, report.html, run.rrd. Each is made although another
cannot be.

Page and pictures are left out where their libraries are not installed, as in the recorder's image.
"""

import traceback
from collections.abc import Callable
from typing import Any

from agent_runtime.io.run_files import write_whole
from operate.doing import doing
from operate.file_names import FAULTS_FILE, REPORT_FILE, RRD_FILE, STEPS, VERDICTS_FILE
from operate.judging.judged import encoded
from operate.recording.run import Run
from operate.reports import report

PAGE_FILE = "report.html"
Say = Callable[..., None]


def everything(run: Run, say: Say, *, again: bool = True) -> bool:
    """Make all three; `say(event, level, **fields)` is told what was made and what was not.

    Where no recorder ended in order its verdicts are made again, too. Not `again`: page and
    pictures that are newer than the recording stay. True: all that can be made here.
    """
    folder = run.place
    try:
        past = run.history
        figures = report.of(past, run.system)
        report.write(folder, figures)
    except Exception:  # the recording stays: the report can be made again by a later version
        say("no report", level="error", why=traceback.format_exc())
        return False
    if not past.whole:
        # no recorder judged it to its end
        write_whole(folder / VERDICTS_FILE, b"".join(map(encoded, past.judged)))
    told = [name for name in ("success", "failure") if hasattr(figures, name)]
    outcome = {name: getattr(figures, name) or "" for name in told}
    say("report", **outcome, file=str(folder / REPORT_FILE))
    wanted = {PAGE_FILE: lambda: _page(run, figures), RRD_FILE: lambda: _pictures(run)}
    old = (name for name in wanted if again or not current(run, name))
    made = [_try(name, wanted[name], say) for name in old]
    return all(made)


def current(run: Run, name: str) -> bool:
    """Whether a file of a run folder is newer than the recording and the logs."""
    sources = (run.file, run.place / FAULTS_FILE, *(run.place / STEPS).glob(f"*.{STEPS}"))
    try:
        made = (run.place / name).stat().st_mtime_ns
    except OSError:
        return False
    return all(one.stat().st_mtime_ns < made for one in sources if one.exists())


def _try(name: str, make: Callable[[], None], say: Say) -> bool:
    try:
        with doing(f"drawing {name}"):
            make()
    except ModuleNotFoundError as error:
        why = (
            f"{error.name} is not installed here; `roco report` makes it where the extra"
            " `monitor` is"
        )
        say("left out", file=name, why=why)
        return True
    except Exception:
        say(f"no {name}", level="error", why=traceback.format_exc())
        return False
    say("made", file=name)
    return True


def _page(run: Run, figures: Any) -> None:
    from operate.reports import page

    past, name, own = run.history, run.place.name, run.system.addition("page")
    text = (
        page.rendered(past, figures, name, run.system) if own is None else own(past, figures, name)
    )
    write_whole(run.place / PAGE_FILE, text.encode())


def _pictures(run: Run) -> None:
    from operate.pictures import file

    file.write(run.place / RRD_FILE, run.history, run.system)
