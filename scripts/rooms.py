"""A contract for import-linter: a room of the project imports only what its row in pyproject.toml
lists.

import-linter's own contracts list what is forbidden; here the short list is what is allowed, other
rooms and packages from outside alike. Only direct imports count: each room has its own row, so the
rows together cover the rest.
"""

import sys
from collections.abc import Sequence

import grimp
from importlinter import Contract, ContractCheck, fields, output


class Room(Contract):
    """`room`: a package or module. `may_import`: packages or modules it may import, besides itself
    and the stdlib.

    `without`: sub-rooms that have a row of their own. In all three, `*` is any one name; but what
    `*` is in an importer of the room, it is in `may_import`: with `tasks.*.plan`, `tasks.*.done` is
    that of the same task.
    """

    type_name = "room"

    room = fields.StringField()
    may_import = fields.ListField(subfield=fields.StringField())
    without = fields.ListField(subfield=fields.StringField(), required=False)

    def check(self, graph: grimp.ImportGraph, verbose: bool) -> ContractCheck:
        """Find every import of the room that its row does not allow."""
        mine = {
            one
            for one in graph.modules
            if within(one, [self.room]) and not within(one, self.without or [])
        }
        if not mine:
            raise ValueError(f"pyproject.toml: there is no room {self.room}")
        broken = sorted(
            (importer, imported)
            for importer in mine
            for imported in graph.find_modules_directly_imported_by(importer)
            if imported.partition(".")[0] not in sys.stdlib_module_names
            and not within(imported, self._allowed(importer))
        )
        return ContractCheck(kept=not broken, metadata={"broken": broken, "graph": graph})

    def _allowed(self, importer: str) -> list[str]:
        """Return what a module of the room may import, with the names that `*` is in it."""
        mine = zip(self.room.split("."), importer.split("."), strict=False)
        names = [name for wanted, name in mine if wanted == "*"]
        allowed = []
        for package in (self.room, *self.may_import):
            left = iter(names)
            allowed.append(
                ".".join(next(left, "*") if one == "*" else one for one in package.split("."))
            )
        return allowed

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Name each import with its line, and what would have been right."""
        for importer, imported in check.metadata["broken"]:
            for detail in check.metadata["graph"].get_import_details(
                importer=importer, imported=imported
            ):
                output.print_error(
                    f"{importer}:{detail['line_number']}: {detail['line_contents']}", bold=False
                )
        output.print_error(f"{self.room} may import: {', '.join(self.may_import)}", bold=False)


def within(module: str, packages: Sequence[str]) -> bool:
    """Tell whether a module is one of these packages or stands inside one; `*` is any one name."""
    return any(_begins(module.split("."), package.split(".")) for package in packages)


def _begins(names: list[str], wanted: list[str]) -> bool:
    return len(names) >= len(wanted) and all(
        one in ("*", name) for name, one in zip(names, wanted, strict=False)
    )
