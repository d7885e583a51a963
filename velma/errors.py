"""The exceptions of this package.

VelmaError
    SceneError      a scene file or a variation asks for something impossible
    MotionError     a motion that the loop must not start
    SlotError       the shared file is not of this version
    BackendError    there is no back-end of this name
        NoRobotError    its function raised: there is no robot behind it now
    GlError         OpenGL does not draw without a display
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


class NoRobotError(BackendError):
    """The function of a back-end raised an exception: there is no robot behind it now."""


class GlError(VelmaError):
    """OpenGL does not draw without a display here, and `why`."""

    PACKAGES = "libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0"
    """All that is needed on Debian 12 and 13, both tried from scratch. Who names them elsewhere
    names all (a test).
    """
    REMEDY = f"Debian (Ubuntu has the same names, not tried): apt install {PACKAGES}"

    def __init__(self, why: str) -> None:
        self.why = why
        super().__init__(f"OpenGL does not draw here: {why}; {self.REMEDY}")
