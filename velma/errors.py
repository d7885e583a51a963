"""The exceptions of this package.

VelmaError
    SceneError      a scene file or a variation asks for something impossible
    MotionError     a motion that the loop must not start
    SlotError       the shared file is not of this version
    BackendError    there is no back-end of this name
    GlError         no OpenGL library can draw without a display
"""


class VelmaError(Exception):
    """Base of the exceptions of this package."""


class SceneError(VelmaError):
    """A scene has something impossible."""

    def __init__(self, field: str, found: object, expected: str) -> None:
        self.field, self.found, self.expected = field, found, expected
        super().__init__(f"scene: {field} is {found!r}, expected {expected}")


class MotionError(VelmaError):
    """A motion that the loop must not start."""

    def __init__(self, field: str, found: object, expected: str) -> None:
        self.field, self.found, self.expected = field, found, expected
        super().__init__(f"motion: {field} is {found}, expected {expected}")


class SlotError(VelmaError):
    """A slot file of another size or version, or a record that does not fit its slot."""

    def __init__(self, path: str, found: object, expected: str) -> None:
        self.path, self.found, self.expected = path, found, expected
        super().__init__(f"slot file {path}: {found}, expected {expected}")


class BackendError(VelmaError):
    """There is no back-end of this name."""

    def __init__(self, name: str, found: str, expected: str, remedy: str) -> None:
        self.name, self.found, self.expected = name, found, expected
        super().__init__(f"back-end {name!r}: {found}, expected {expected}; {remedy}")


class GlError(VelmaError):
    """No OpenGL library that draws without a display works here."""

    REMEDY = "Debian: apt install libegl1 libegl-mesa0 libgl1-mesa-dri, or apt install libosmesa6"

    def __init__(self, tried: str) -> None:
        self.tried = tried
        super().__init__(f"OpenGL: none of {tried} works here, the head camera needs one; {self.REMEDY}")
