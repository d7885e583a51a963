"""The act that opens a leaf, and what must be true after it."""

from companion.languages.evidence import AnyClaim, Check, Otherwise, Sense
from companion.languages.facts import AnyKind
from companion.languages.rc import Angle, ApproachPoint, Bend, Command, FingerSpeed
from companion.languages.values import Name, Pose, Side
from companion.rows import THERE, ActRow, ShownRow


class OpenDoor(Command, frozen=True):
    """Take a leaf by its handle, turn it about its hinge, let go, draw the hand back, and look at
    the leaf.

    `approach`: in the leaf's frame, outermost first, the handle last. Fingers: `closed`, where one
    stops that meets nothing [rad], `squeeze` and `speed` as of Grasp. `turn`: of the leaf about its
    z from where it is seen before [rad]. `least`: size of the turn that is enough. `end`: of the
    hand in the leaf's frame after the turn, in which the fingers slide about the bar; None: as at
    its begin.
    """

    side: Side
    door: Name
    approach: tuple[ApproachPoint, ...]
    closed: Bend
    squeeze: Bend
    speed: FingerSpeed
    turn: Angle
    least: Angle
    end: Pose | None = None


class DoorClaim(AnyClaim):
    """What is true of a leaf."""

    OPEN = "open"  # it is turned


class DoorKind(AnyKind):
    """Why a leaf is not opened."""

    HANDLE_UNREACHED = "handle-unreached", "side a"
    TOUCHED_HANDLE = "touched-handle", "side a x:fingers"
    NO_WAY_TO_OPEN = "no-way-to-open", "side a"
    NOT_TURNED = "not-turned", "side a because"
    NOT_SEEN_TURNED = "not-seen-turned", "a"
    TURNED_TOO_LITTLE = "turned-too-little", "a x:rad y:rad"  # by, needed


_OPEN = Check(DoorClaim.OPEN, "door", (Sense.EYES,), Otherwise.FAILED)
ACTS = (ActRow(OpenDoor, (THERE, _OPEN), rest_s=20.0, handles=True),)
SHOWN = (
    ShownRow(OpenDoor, "open", "#78350f", "opens a door", "opened", ("door",), points_on="door"),
)
