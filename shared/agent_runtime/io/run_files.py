"""Names in a run folder, and the environment variables that name it (docs/run-folder.md)."""

RUN_FOLDER_VARIABLE = "ROCO_RUN_DIR"
KEYS_VARIABLE = "ROCO_TLS_DIR"  # a folder of keys; none: nothing is encrypted
KEYS_FOLDER = "keys"  # certificates and private keys of this run, mode 0700 (docs/security.md)
# The stop flag: one byte, written in place (a process may hold the file mapped; a rename would cut it off).
STOP_FILE = "stop"
STOP_RELEASED = b"\x00"
STOP_HELD = b"\x01"
