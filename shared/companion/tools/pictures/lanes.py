"""Lanes of states of this robot beside those of any system: the plan's step, ex's act, the loop's mode."""

from companion.languages import rc, sw
from companion.sentences import Reader
from companion.sentences import step as worded
from companion.telemetry import RobotState
from companion.wording import spaced
from fipa_codec.performatives import Performative
from operate.pictures.happenings import Happening
from operate.pictures.lanes import REST, Lane
from operate.pictures.sheet import Sheet
from operate.recording.records import Spoken

PLAN, ACT, LOOP = "agents/ta/plan", "agents/ex/act", "agents/ex/loop"


class ActLanes:
    """Draws each change."""

    def __init__(self, sheet: Sheet) -> None:
        self._plan, self._acts, self._loop = (Lane(sheet, place) for place in (PLAN, ACT, LOOP))
        self._act = ""

    def take(self, happening: Happening) -> None:
        """Draw what changed."""
        at = happening.at
        match happening.what:
            case RobotState() as robot:
                self._loop.enter(at, robot.mode or REST)
            case Spoken(content=sw.Report() as report):
                step = worded(report.at.step, Reader.OPERATOR) if report.at and report.at.step else self._plan.now
                self._plan.enter(at, REST if report.state in sw.FINAL else step or REST)
            case Spoken(channel="C5") as one:
                self._acting(at, one)

    def _acting(self, at: float, one: Spoken) -> None:
        """ex's lane: from agree, when the robot begins to move, to the end of the act."""
        if isinstance(one.content, rc.Command):
            self._act = spaced(type(one.content).__name__)
        elif isinstance(one.content, rc.Accepted) or one.performative == Performative.AGREE:
            self._acts.enter(at, self._act or REST)
        elif isinstance(one.content, rc.Done | rc.NotDone):
            self._acts.enter(at, REST)
