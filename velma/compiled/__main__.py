"""Build the library of the parts in C; exit code 1 and a line of why where that cannot be done."""

import os
import shutil
import subprocess
import sys

from velma.compiled import FOLDER, SOURCES, built

FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared")
"""Without contraction a product and a sum are rounded as in numpy, so that the plain code can be
compared exactly.
"""
WITHIN_S = 60.0  # estimate; it takes one


def build() -> str:
    """Build the library beside its sources, unless it is there; return why not, or nothing."""
    target = built()
    compiler = (
        os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    )
    if target.exists() or compiler is None:
        return (
            "" if target.exists() else "there is no C compiler (Debian: apt install gcc libc6-dev)"
        )
    new = target.with_suffix(f".{os.getpid()}")
    sources = (str(source) for source in SOURCES if source.suffix == ".c")
    command = [compiler, *FLAGS, *sources, "-o", str(new), "-lm"]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=WITHIN_S)
        for old in FOLDER.glob("velma-*.so"):
            old.unlink()
        new.replace(target)
    except (OSError, subprocess.SubprocessError) as error:
        new.unlink(missing_ok=True)
        return f"{compiler} failed: {getattr(error, 'stderr', None) or error}"
    return ""


if __name__ == "__main__":
    why = build()
    if why:
        sys.exit(why)
