"""Errors of the scaffold; one kind: no project can be made, because of a name or a folder."""

from topdown.model.errors import TopdownError


class ScaffoldError(TopdownError):
    """No project can be made of this: `where`, what is `wrong`, what would be `right`."""

    def __init__(self, where: str, wrong: str, right: str) -> None:
        self.where, self.wrong, self.right = where, wrong, right
        super().__init__(f"{where}: {wrong}; {right}")
