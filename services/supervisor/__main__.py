"""`python -m services.supervisor`: the supervisor of any system (operate.supervisor), bound to this
one.
"""

import os

import typer

from companion.tools.system import SYSTEM
from operate.supervisor.__main__ import main
from operate.system import ENTRY_VARIABLE

if __name__ == "__main__":
    os.environ[ENTRY_VARIABLE] = SYSTEM.entry
    typer.run(main)
