"""python slow_process.py <endpoint> <file>: hears everything; the test stops it again and again."""

import sys
import threading
from pathlib import Path

import zenoh

from agent_runtime.io.sessions import client_config

with zenoh.open(client_config(sys.argv[1])) as session:
    declared = session.declare_subscriber("**", lambda sample: None)
    Path(sys.argv[2]).touch()
    threading.Event().wait()
