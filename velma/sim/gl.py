"""OpenGL contexts without a display: by EGL, else by OSMesa. Both draw in software where there is no graphics card.

`MUJOCO_GL` in the environment means what it means to MuJoCo: egl, osmesa, or off for neither. A context belongs to the
thread that made it. A process that has one must not be forked, the child would hang: start children by `subprocess`.
"""

import ctypes
import importlib
import os
from typing import Any

from velma.errors import GlError

EGL, OSMESA = "egl", "osmesa"
LIBRARIES = {EGL: "libEGL.so.1", OSMESA: "libOSMesa.so.8"}
"""The names under which Debian 12 has them."""
OFF = ("disable", "disabled", "off", "false", "0")
_PLATFORM_DEVICE = 0x313F  # EGL_PLATFORM_DEVICE_EXT of EGL_EXT_platform_device: the only platform that MuJoCo tries
_MOST_DEVICES = 8


def found() -> str:
    """Return the name of the library that works here, EGL first; "" if none does, or none is to be used."""
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    names = (asked,) if asked in LIBRARIES else () if asked in OFF else (EGL, OSMESA)
    return next((name for name in names if _works(name)), "")


def required() -> str:
    """Return the name of the library that works here. Raises GlError where neither does."""
    if name := found():
        return name
    raise missing()


def missing() -> GlError:
    """Return the error of a machine where neither library works."""
    return GlError(", ".join(LIBRARIES.values()))


def context(width: int, height: int) -> Any:
    """Return a context of this thread that is current, for pictures of width x height pixels.

    Raises GlError where neither library works.
    """
    made = importlib.import_module(f"mujoco.{required()}").GLContext(width, height)
    made.make_current()
    return made


def _works(name: str) -> bool:
    """Whether the library is there and, of EGL, a driver with a device."""
    try:
        library = ctypes.CDLL(LIBRARIES[name])
    except OSError:
        return False
    return name == OSMESA or _has_device(library)


def _has_device(egl: ctypes.CDLL) -> bool:
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    query, display_of = (egl.eglGetProcAddress(name) for name in (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT"))
    if not query or not display_of:
        return False
    devices, count = (ctypes.c_void_p * _MOST_DEVICES)(), ctypes.c_int(0)
    kind = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    if not kind(query)(_MOST_DEVICES, ctypes.byref(devices), ctypes.byref(count)):
        return False
    open_display = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(display_of)
    egl.eglInitialize.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
    displays = (open_display(_PLATFORM_DEVICE, device, None) for device in devices[: count.value])
    return any(display and egl.eglInitialize(display, None, None) for display in displays)
