# Shared by the scripts of this folder (bash, sourced): go to the project's root, make .venv, install what is locked.
#
# The first run takes a minute or so and says what it does; a later one only compares a stamp. Needs nothing but bash and a
# Python with venv. Everything else comes from the package index, versions and hashes as locked.

# Python versions for which each locked package has a wheel, on x86_64 and aarch64 (tests/test_setup.py compares).
SUPPORTED=(3.11 3.12 3.13)

cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."

say() { printf '\033[2m--\033[0m %s\n' "$*" >&2; }
die() {
    printf '\033[31merror:\033[0m %s\n' "$*" >&2
    exit 2
}
if ! [ -t 2 ]; then
    say() { printf -- '-- %s\n' "$*" >&2; }
    die() {
        printf 'error: %s\n' "$*" >&2
        exit 2
    }
fi

# Print the version of an interpreter as 3.11; nothing if it does not run.
version_of() { "$1" -I -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }

supported() { [[ -n $1 && " ${SUPPORTED[*]} " == *" $1 "* ]]; }

# Print the first supported Python that can make an environment; fail without one. ROCO_PYTHON names one explicitly.
find_python() {
    local candidate
    if [ -n "${ROCO_PYTHON:-}" ]; then
        supported "$(version_of "$ROCO_PYTHON")" ||
            die "ROCO_PYTHON=$ROCO_PYTHON is $("$ROCO_PYTHON" --version 2>&1 | tail -n 1), expected one of Python ${SUPPORTED[*]}"
        echo "$ROCO_PYTHON"
        return
    fi
    for candidate in "${SUPPORTED[@]/#/python}" python3 python; do
        if supported "$(version_of "$candidate")" && "$candidate" -I -c 'import venv, ensurepip' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    return 1
}

# Whether .venv is whole: of a supported version, the one it was made with, and that of ROCO_PYTHON if this is set.
venv_fits() {
    local version
    version=$(version_of .venv/bin/python)
    supported "$version" && [ -d ".venv/lib/python$version" ] &&
        { [ -z "${ROCO_PYTHON:-}" ] || [ "$(version_of "$ROCO_PYTHON")" = "$version" ]; }
}

# Make .venv with an interpreter and uv in it, where it is missing or does not fit.
setup_venv() {
    local python
    if ! venv_fits; then
        if python=$(find_python); then
            say "making .venv with $("$python" --version)"
            "$python" -I -m venv --clear .venv ||
                die "$python -I -m venv failed (Debian: apt install python3-venv, then call this again)"
        elif [ -n "${ROCO_PYTHON:-}" ]; then
            exit 2 # find_python said why
        else
            venv_by_uv
        fi
    fi
    if ! .venv/bin/uv --version >/dev/null 2>&1; then
        say "getting uv into .venv"
        .venv/bin/python -P -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/uv.txt ||
            die "pip could not get uv (see above); is the package index reachable?"
    fi
}

# Make .venv by uv, which installs a supported Python if the machine has none. uv itself is got by any Python.
venv_by_uv() {
    local python tools uv oldest=${SUPPORTED[0]} newest=${SUPPORTED[-1]}
    uv=$(command -v uv) || {
        for python in python3 python none; do
            "$python" -I -c 'import venv, ensurepip' 2>/dev/null && break
        done
        [ "$python" != none ] ||
            die "no Python with venv found, expected one of ${SUPPORTED[*]} (Debian: apt install python3 python3-venv); ROCO_PYTHON=<path> names one"
        tools=$(mktemp -d)
        uv=$tools/bin/uv
        { "$python" -I -m venv "$tools" && "$tools/bin/pip" install --quiet --disable-pip-version-check --require-hashes -r requirements/uv.txt; } ||
            die "$("$python" --version) could not get uv (see above); is the package index reachable?"
    }
    say "no Python ${SUPPORTED[*]} that can make .venv is on the path (python3 is $(version_of python3)); uv installs Python $newest for this project"
    "$uv" venv --quiet --clear --python ">=$oldest,<=$newest.999" .venv && "$uv" pip install --quiet --python .venv/bin/python --require-hashes -r requirements/uv.txt ||
        die "uv could not make .venv (see above); install one of Python ${SUPPORTED[*]}, ROCO_PYTHON=<path> names it"
    [ -z "${tools:-}" ] || rm -rf "$tools"
}

# Make .venv hold what is locked, and the project itself, editable. Quick when nothing changed since the last time.
setup() {
    local stamp=.venv/.locked want
    want=$(cksum requirements/all.txt pyproject.toml scripts/setup.sh velma/compiled/*.[ch] shared/topdown/prove/compiled/*.c && pwd)
    if [ "$(cat "$stamp" 2>/dev/null)" = "$want" ] && venv_fits; then
        return
    fi
    setup_venv
    say "installing what requirements/all.txt locks (about 0.6 GB the first time)"
    .venv/bin/uv pip sync --python .venv/bin/python --require-hashes requirements/all.txt || die "uv could not install (see above)"
    say "installing the project itself, editable"
    .venv/bin/uv pip install --quiet --python .venv/bin/python --no-deps --no-build-isolation --editable . ||
        die "uv could not install the project (see above)"
    relative_paths
    lend_libgomp
    .venv/bin/python -P -m velma.compiled || say "without that library planning takes twice as long (see above)"
    .venv/bin/python -P -m topdown.prove.compiled || say "without that library large designs are verified 15 to 48 times more slowly (see above)"
    check_libraries
    printf '%s\n' "$want" >"$stamp"
}

# Python 3.11 and 3.12 read the paths that an editable install adds in the letters of the locale: with LC_ALL=C, a folder
# such as Röbot would end each Python at its start. A relative path has no letter of it.
relative_paths() {
    .venv/bin/python -S -P - <<'PYTHON'
import os
from pathlib import Path

for file in Path(".venv/lib").glob("python3.*/site-packages/_editable_impl_robot_companion.pth"):
    paths = map(os.fsdecode, file.read_bytes().splitlines())
    file.write_text("\n".join(dict.fromkeys(os.path.relpath(path, file.parent) for path in paths)) + "\n")
PYTHON
}

# pinocchio's wheel wants the system's libgomp.so.1 (GNU's OpenMP), which a small machine may lack. Then take the copy that
# another wheel carries and lay it where pinocchio's run path looks; nothing of the machine is touched.
lend_libgomp() {
    .venv/bin/python -P -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null && return
    say "libgomp.so.1 is not on this machine (Debian: libgomp1); taking the copy of a wheel"
    .venv/bin/uv pip install --quiet --python .venv/bin/python --target .venv/lend --no-deps --require-hashes \
        -r requirements/libgomp.txt || die "uv could not get it; instead (Debian): apt install libgomp1"
    .venv/bin/python -P - <<'PYTHON' || die "no libgomp in that wheel; instead (Debian): apt install libgomp1"
import shutil
from pathlib import Path

copy = next(Path(".venv/lend").rglob("libgomp*.so.1*"))
for packages in Path(".venv/lib").glob("python3.*/site-packages/cmeel.prefix/lib"):
    (packages / "libgomp.so.1").unlink(missing_ok=True)
    (packages / "libgomp.so.1").symlink_to(copy.resolve())
shutil.rmtree(".venv/lend/sklearn", ignore_errors=True)  # 40 MB that nobody uses; a second try finds them gone
PYTHON
}

# Import what needs system libraries, so that a missing one is named here and not in the middle of a run. Without OpenGL
# all but the head camera works: that is said, too, and goes on.
check_libraries() {
    .venv/bin/python -P - <<'PYTHON' || die "a system library is missing (see above)"
import importlib
import sys

packages = {"libgomp.so": "libgomp1", "libstdc++.so": "libstdc++6"}
failed = False
for module in ("numpy", "zenoh", "pinocchio", "coal", "ompl", "mujoco", "cv2", "rerun"):
    try:
        importlib.import_module(module)
    except ImportError as error:
        failed = True
        debian = next((package for library, package in packages.items() if library in str(error)), None)
        print(f"{module} cannot be imported: {error}", file=sys.stderr)
        if debian:
            print(f"  Debian: apt install {debian}", file=sys.stderr)
from velma.sim import gl

if why := gl.lost():  # only pictures of the head camera, and seeing by them, need it
    print("no pictures of the head camera, and the robot sees by rays (docs/eyes.md):", file=sys.stderr)
    print(f"  {why}", file=sys.stderr)
sys.exit(failed)
PYTHON
}
