"""The plan as text: its machine's states, what is behind, and the leaf ta is in."""

from companion.languages import hfsm, sw
from companion.sentences import does, plain
from operate.pictures.sheet import Sheet, documents
from operate.pictures.stage import Happening
from operate.recording.records import Spoken

PLAN = "plan"
Path = tuple[str, ...]


class Plan:
    """Writes the plan again when it or ta's place in it changes."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._plan: hfsm.HierarchicalPlan | None = None
        self._number = 0
        self._behind: set[Path] = set()
        self._at: Path = ()
        self._outcome = ""
        sheet.add(PLAN, documents, sheet.begin, "No plan yet.")

    def take(self, happening: Happening) -> None:
        """Note a plan given to ta, and ta's reports."""
        match happening.what:
            case Spoken(channel="C1", content=hfsm.HierarchicalPlan() as plan):
                self._plan, self._at, self._outcome, self._behind = plan, (), "", set()
                self._number += 1
            case Spoken(content=sw.Report() as report) if self._plan is not None:
                self._report(report)
            case _:
                return
        if (plan := self._plan) is None:
            return
        head = f"**Plan {self._number}: {plain(plan.task)}** – {self._outcome or 'under way'}"
        self._sheet.add(
            PLAN, documents, happening.at, "\n".join((head, "", *self._lines(plan.root, ())))
        )

    def _report(self, report: sw.Report) -> None:
        if report.at is not None and report.at.path != self._at:
            if self._at:
                self._behind.add(self._at)
                if self._at[0] != report.at.path[0]:
                    self._behind.add(self._at[:1])
            self._at = report.at.path
        if report.state in sw.FINAL:
            self._outcome, self._at = report.state.lower(), ()

    def _lines(self, machine: hfsm.Machine, path: Path) -> list[str]:
        lines: list[str] = []
        for state in machine.states:
            here = (*path, state.name)
            lines.append("  " * len(path) + "- " + self._line(here, does(state)))
            if isinstance(state, hfsm.Machine) and self._at[: len(here)] == here:
                lines += self._lines(state, here)
        return lines

    def _line(self, here: Path, name: str) -> str:
        """`here` is behind, the leaf ta is in, around it, or not yet begun."""
        if here == self._at:
            return f"**▶ {name}**"
        if self._at[: len(here)] == here:
            return f"**{name}**"
        return f"✓ {name}" if here in self._behind else name
