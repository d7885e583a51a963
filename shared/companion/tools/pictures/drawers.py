"""Pictures of this robot beside those of any system: robot, things, beliefs, acts, camera, plan, numbers, lanes."""

from companion.tools.pictures.acts import Acts
from companion.tools.pictures.believed import Believed
from companion.tools.pictures.camera import Camera
from companion.tools.pictures.imagined import Imagined
from companion.tools.pictures.lanes import ActLanes
from companion.tools.pictures.plan import Plan
from companion.tools.pictures.scene import Contacts, Scene
from companion.tools.pictures.signals import Signals
from companion.tools.pictures.velma import Velma
from operate.pictures.sheet import Sheet
from operate.pictures.stage import Drawer


def drawers(sheet: Sheet) -> tuple[Drawer, ...]:
    """Return all of them, in the order in which they draw."""
    scene = Scene(sheet)
    return (
        Velma(sheet),
        scene,
        Contacts(sheet),
        Believed(sheet, scene),
        Acts(sheet, scene),
        Imagined(sheet, scene),
        Camera(sheet),
        ActLanes(sheet),
        Plan(sheet),
        Signals(sheet),
    )
