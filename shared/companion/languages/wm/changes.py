"""Changes that a hypothetical state makes to another one."""

import msgspec

from companion.languages.values import Pose, Shape, Side


class Change(msgspec.Struct, frozen=True, tag=True):
    """A change in a hypothetical state."""


class Moved(Change, frozen=True):
    """The object stands here; `exact` False: the pose is only predicted."""

    object: str
    pose: Pose
    on: str = ""
    exact: bool = False


class Grasped(Change, frozen=True):
    """The hand holds the object; `pose` is T_grip_object."""

    object: str
    side: Side
    grasp: str
    pose: Pose


class Released(Change, frozen=True):
    """The hand holds nothing."""

    side: Side


class Configured(Change, frozen=True):
    """Joints of the body [rad]: `part` is torso, right_arm, left_arm, head, right_hand or left_hand."""

    part: str
    q: tuple[float, ...]


class Reserved(Change, frozen=True):
    """This space is kept free (True) or free again (False) under this name."""

    name: str
    volume: Shape | None


class Poured(Change, frozen=True):
    """The content of source is in destination."""

    source: str
    destination: str


AnyChange = Moved | Grasped | Released | Configured | Reserved | Poured
