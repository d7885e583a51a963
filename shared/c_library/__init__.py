"""Libraries in C that replace slow loops in Python, for machines with a compiler.

Without its library a loop runs in Python, slower and with the same results, which tests compare.
The name of a library's file carries a checksum of its sources and the architecture, so that no
other library is loaded. ROCO_PLAIN=1 leaves out all libraries.
"""

import ctypes
import os
import platform
import shutil
import subprocess
import sys
import zlib
from pathlib import Path
from typing import NamedTuple

FLAGS = ("-std=c11", "-O3", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")
COMPILER = "a C compiler (Debian: apt install gcc libc6-dev)"
WITHIN_S = 60.0  # estimate; it takes one


class CLibrary(NamedTuple):
    """The C files of one folder and the library that is built beside them.

    `name`: of the library's file, before the checksum. `options`: of the compiler, besides FLAGS.
    """

    name: str
    folder: Path
    options: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        """The library of these sources, whether or not it is built."""
        sources = sorted(self.folder.glob("*.[ch]"))
        checksum = zlib.crc32(b"".join(source.read_bytes() for source in sources))
        return self.folder / f"{self.name}-{checksum:08x}-{platform.machine()}.so"

    def load(self) -> ctypes.CDLL | None:
        """The library; None if it is not built, does not load here, or ROCO_PLAIN is set."""
        if os.environ.get("ROCO_PLAIN"):
            return None
        try:
            return ctypes.CDLL(str(self.path))
        except OSError:
            return None

    def build(self) -> str:
        """Build the library unless it is there, and remove older ones; return the error, or ""."""
        target = self.path
        if target.exists():
            return ""
        known = filter(None, map(shutil.which, ("cc", "gcc", "clang")))
        compiler = os.environ.get("CC") or next(known, None)
        if compiler is None:
            return f"there is no C compiler; {self.name} needs {COMPILER}"
        new = target.with_suffix(f".{os.getpid()}")
        sources = map(str, sorted(self.folder.glob("*.c")))
        command = [compiler, *FLAGS, *sources, "-o", str(new), *self.options]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True, timeout=WITHIN_S)
            for old in self.folder.glob(f"{self.name}-*.so"):
                old.unlink()
            new.replace(target)
        except (OSError, subprocess.SubprocessError) as error:
            new.unlink(missing_ok=True)
            return f"{compiler} failed: {getattr(error, 'stderr', None) or error}"
        return ""

    def main(self) -> None:
        """Build the library; exit with 1 and the error on standard error where that fails."""
        if why := self.build():
            sys.exit(why)
