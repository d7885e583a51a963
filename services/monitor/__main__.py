"""`python -m services.monitor`: the monitor of any system (operate.recording), bound to this
one.
"""

import os

from companion.tools.system import SYSTEM
from operate.recording.__main__ import main
from operate.system import ENTRY_VARIABLE

if __name__ == "__main__":
    os.environ[ENTRY_VARIABLE] = SYSTEM.entry
    main()
