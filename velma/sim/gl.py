"""OpenGL contexts without a display: by EGL, else by OSMesa. Both draw in software where there is
no graphics card.

`required` and `lost` draw in a process of their own: only that tells whether it works here.
`MUJOCO_GL` in the environment means what it means to MuJoCo: egl, osmesa, or off for neither. A
context belongs to the thread that made it. A process that has one must not be forked, the child
would hang: start children by `subprocess`.
"""

import ctypes
import importlib
import os
import signal
import subprocess
import sys
from typing import Any

from velma.errors import GlError

EGL, OSMESA = "egl", "osmesa"
LIBRARIES = {EGL: "libEGL.so.1", OSMESA: "libOSMesa.so.8"}
FUNCTIONS = ("libOpenGL.so.0", "libGL.so.1")
"""One of them has the functions of OpenGL that go with EGL; OSMesa has its own."""
OFF = ("disable", "disabled", "off", "false", "0")
# EGL_PLATFORM_DEVICE_EXT of EGL_EXT_platform_device: the only platform that MuJoCo tries
_PLATFORM_DEVICE = 0x313F
_MOST_DEVICES = 8
_SIDE = 8  # of the picture that is drawn to try it [pixels]
_COLOUR = (255, 128, 0)
_WITHIN_S = 60.0  # estimate: it takes 0.5 s, or 20 on a machine with much other work


def required() -> str:
    """Return the name of the library that draws here. Raises GlError where none does, with what is
    in the way.

    A process of its own draws as the robot's will, and reads a pixel of it: so a library that
    vanished is noticed, and one that kills the process is survived.
    """
    command = [sys.executable, "-P", "-m", "velma.sim.gl"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_WITHIN_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise GlError(f"nothing was drawn within {_WITHIN_S:g} s") from None
    if done.returncode < 0:
        raise GlError(
            f"{signal.Signals(-done.returncode).name} killed the process that tried to draw"
        )
    if done.returncode:
        raise GlError((done.stderr.splitlines() or [f"exit status {done.returncode}"])[-1])
    return done.stdout.strip()


def lost() -> str:
    """Return why nothing can be drawn here, and what to install; "" where `required` returns a
    name.
    """
    try:
        required()
    except GlError as error:
        return str(error)
    return ""


def context(width: int, height: int) -> Any:
    """Return a context of this thread that is current, for pictures of width x height pixels.

    Raises GlError where none can be made.
    """
    name = _chosen()
    try:
        made = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
        made.make_current()
    except Exception as error:  # of PyOpenGL, MuJoCo or a driver: they declare none
        raise GlError(
            f"{name} makes no context: {type(error).__name__}: {' '.join(str(error).split())}"
        ) from error
    return made


def drawn() -> str:
    """Draw in a context of this thread and read a pixel of it; return the name of the library.

    Raises GlError where that fails.
    """
    # first: MuJoCo cannot be imported where MUJOCO_GL names a library that is not here
    name = _chosen()
    import mujoco  # only here: who asks by `required` needs no simulator
    import numpy as np

    made = context(_SIDE, _SIDE)
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    model.vis.global_.offwidth = model.vis.global_.offheight = _SIDE
    try:
        scene = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, scene)
        area, pixels = mujoco.MjrRect(0, 0, _SIDE, _SIDE), np.zeros((_SIDE, _SIDE, 3), np.uint8)
        mujoco.mjr_rectangle(area, *(part / 255 for part in _COLOUR), 1.0)
        mujoco.mjr_readPixels(pixels, None, area, scene)
        scene.free()
    except mujoco.FatalError as error:
        raise GlError(f"{name} does not draw: {error}") from error
    finally:
        made.free()
    found = tuple(pixels[_SIDE // 2, _SIDE // 2].tolist())
    if found != _COLOUR:
        raise GlError(f"{name} drew a pixel of colour {_COLOUR} as {found}")
    return name


def _chosen() -> str:
    """Return the name of the first library of which everything is here. Raises GlError where there
    is none.
    """
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    if asked in OFF:
        raise GlError(f"MUJOCO_GL={asked} in the environment forbids it")
    lacks = {name: _lack(name) for name in ((asked,) if asked in LIBRARIES else LIBRARIES)}
    found = next((name for name, lack in lacks.items() if not lack), "")
    if not found:
        raise GlError(" and ".join(lacks.values()))
    return found


def _lack(name: str) -> str:
    """Return what of a library is not here; "" where nothing of it lacks."""
    try:
        library = ctypes.CDLL(LIBRARIES[name])
    except OSError as error:
        # which begins with the name
        return f"no {LIBRARIES[name]}" if "No such file" in str(error) else str(error)
    if name == OSMESA:
        return ""
    if not any(_loads(one) for one in FUNCTIONS):
        return f"no {' or '.join(FUNCTIONS)}"
    return "" if _has_device(library) else f"{LIBRARIES[EGL]} finds no driver that can be used"


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _has_device(egl: ctypes.CDLL) -> bool:
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    query, display_of = (
        egl.eglGetProcAddress(name) for name in (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT")
    )
    if not query or not display_of:
        return False
    devices, count = (ctypes.c_void_p * _MOST_DEVICES)(), ctypes.c_int(0)
    kind = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    if not kind(query)(_MOST_DEVICES, ctypes.byref(devices), ctypes.byref(count)):
        return False
    open_display = ctypes.CFUNCTYPE(
        ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p
    )(display_of)
    egl.eglInitialize.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
    displays = (open_display(_PLATFORM_DEVICE, device, None) for device in devices[: count.value])
    return any(display and egl.eglInitialize(display, None, None) for display in displays)


if __name__ == "__main__":
    try:
        print(drawn())
    except GlError as error:
        sys.exit(error.why)
