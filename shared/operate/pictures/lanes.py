"""States over time: a lane per agent, the loop's, the plan's, ex's acts. States of rest are grey, others stand out."""

import rerun as rr

from companion.design import DESIGN
from companion.languages import rc, sw
from companion.telemetry import RobotState
from companion.wording import plain, spaced
from fipa_codec.performatives import Performative
from operate.pictures.colours import FRESH, GREY, RED
from operate.pictures.happenings import Happening
from operate.pictures.sheet import Sheet, states
from operate.recording.history import Entered
from operate.recording.records import Spoken

REST = "–"
GONE = "gone"
RESTING = ("idle", "trigger", "listening", REST)
PLAN, ACT, LOOP = "agents/ta/plan", "agents/ex/act", "agents/ex/loop"


class Lanes:
    """Draws each change of a lane."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet = sheet
        self._known: dict[str, list[str]] = {}
        self._now: dict[str, str] = {}
        self._act = ""
        for agent, entry in DESIGN.agents.items():
            self._known[f"agents/{agent}"] = [state.name for state in entry.state]

    def take(self, happening: Happening) -> None:
        """Draw what changed."""
        at = happening.at
        match happening.what:
            case Entered(agent=agent, state=state, alive=alive) if agent in DESIGN.agents and (state or not alive):
                self._enter(at, f"agents/{agent}", state if alive else GONE)
            case RobotState() as robot:
                self._enter(at, LOOP, robot.mode or REST)
            case Spoken(content=sw.Report() as report):
                step = plain(report.at.partition("/")[0])
                self._enter(at, PLAN, REST if report.state in sw.FINAL else step or self._now.get(PLAN, REST))
            case Spoken(channel="C5") as one:
                self._acting(at, one)

    def _acting(self, at: float, one: Spoken) -> None:
        """ex's lane: from agree, when the robot begins to move, to the end of the act."""
        if isinstance(one.content, rc.Command):
            self._act = spaced(type(one.content).__name__)
        elif isinstance(one.content, rc.Accepted) or one.performative == Performative.AGREE:
            self._enter(at, ACT, self._act or REST)
        elif isinstance(one.content, rc.Done | rc.NotDone):
            self._enter(at, ACT, REST)

    def _enter(self, at: float, lane: str, state: str) -> None:
        if self._now.get(lane) == state:
            return
        known = self._known.setdefault(lane, [])
        if lane not in self._now or state not in known:
            known += [state] if state not in known else []
            colours = [RED if name == GONE else GREY if name in RESTING else FRESH for name in known]
            self._sheet.static(lane, rr.StateConfiguration(values=known, labels=known, colors=colours))
        self._now[lane] = state
        self._sheet.add(lane, states, at, state)
