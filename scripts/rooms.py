"""A contract for import-linter: a room of the project imports only what its row in pyproject.toml lists.

import-linter's own contracts list what is forbidden; here the short list is what is allowed, other rooms and packages
from outside alike. Only direct imports count: each room has its own row, so the rows together cover the rest.
"""

import sys
from collections.abc import Sequence

import grimp
from importlinter import Contract, ContractCheck, fields, output


class Room(Contract):
    """`room`: a package or module. `may_import`: packages or modules it may import, besides itself and the stdlib.

    `without`: sub-rooms that have a row of their own.
    """

    type_name = "room"

    room = fields.StringField()
    may_import = fields.ListField(subfield=fields.StringField())
    without = fields.ListField(subfield=fields.StringField(), required=False)

    def check(self, graph: grimp.ImportGraph, verbose: bool) -> ContractCheck:
        """Find every import of the room that its row does not allow."""
        allowed = [self.room, *self.may_import]
        rooms = {self.room} | graph.find_descendants(self.room)
        mine = {module for module in rooms if not within(module, self.without or [])}
        broken = sorted(
            (importer, imported)
            for importer in mine
            for imported in graph.find_modules_directly_imported_by(importer)
            if imported.partition(".")[0] not in sys.stdlib_module_names and not within(imported, allowed)
        )
        return ContractCheck(kept=not broken, metadata={"broken": broken, "graph": graph})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Name each import with its line, and what would have been right."""
        for importer, imported in check.metadata["broken"]:
            for detail in check.metadata["graph"].get_import_details(importer=importer, imported=imported):
                output.print_error(f"{importer}:{detail['line_number']}: {detail['line_contents']}", bold=False)
        output.print_error(f"{self.room} may import: {', '.join(self.may_import)}", bold=False)


def within(module: str, packages: Sequence[str]) -> bool:
    """Tell whether a module is one of these packages or stands inside one."""
    return any(module == package or module.startswith(package + ".") for package in packages)
