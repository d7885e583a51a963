"""What can go wrong with Velma, as one family.

VelmaError
    SceneError      a scene file or a variation asks for something that cannot be
    MotionError     a motion that the loop may not begin
    SlotError       the shared file is not what this version reads
"""


class VelmaError(Exception):
    """Base of this package's own errors."""


class SceneError(VelmaError):
    """A scene holds something that cannot be."""

    def __init__(self, field: str, found: object, expected: str) -> None:
        self.field, self.found, self.expected = field, found, expected
        super().__init__(f"scene: {field} is {found!r}, expected {expected}")


class MotionError(VelmaError):
    """A motion that the loop may not begin."""

    def __init__(self, field: str, found: object, expected: str) -> None:
        self.field, self.found, self.expected = field, found, expected
        super().__init__(f"motion: {field} is {found}, expected {expected}")


class SlotError(VelmaError):
    """A slot file of another size or version, or a record that does not fit its slot."""

    def __init__(self, path: str, found: object, expected: str) -> None:
        self.path, self.found, self.expected = path, found, expected
        super().__init__(f"slot file {path}: {found}, expected {expected}")
