"""Whose code may run: a file or a folder is trusted where only the caller and root can change what
it holds.

A run's fleet.json and a project's pyproject.toml name Python code. Root who looks at a user's run,
or anybody below a folder that others write to, would run theirs.
"""

import grp
import os
import pwd
import stat
from pathlib import Path

TRUST_VARIABLE = "ROCO_TRUST"
"""Folders that the caller trusts whoever owns them, a colon between, with all that is below
them.
"""
ACCESS_LIST = "system.posix_acl_access"


def changeable(place: Path) -> str:
    """Say who besides the caller and root could change this file, or what is in this folder; ""
    where nobody could.

    The folders above count, too: who can rename one of them can put another in its place. In one
    with the sticky bit, as /tmp, only the owner of an entry can.
    """
    place = place.resolve()
    trusted = [
        Path(one).resolve() for one in os.environ.get(TRUST_VARIABLE, "").split(os.pathsep) if one
    ]
    if any(place.is_relative_to(one) for one in trusted):
        return ""
    found = (_changeable(one, sticky=one != place) for one in (place, *place.parents))
    return next(filter(None, found), "")


def _changeable(place: Path, sticky: bool) -> str:
    try:
        found = place.stat()
        listed = ACCESS_LIST in os.listxattr(place)
    except OSError as error:
        return f"{place} cannot be looked at ({error.strerror})"
    if found.st_uid not in _safe():
        return f"{place} belongs to {_user(found.st_uid)}"
    if sticky and found.st_mode & stat.S_ISVTX:
        return ""
    if found.st_mode & stat.S_IWOTH:
        return f"every user can write to {place}"
    if found.st_mode & stat.S_IWGRP and (listed or not _alone(found.st_gid)):
        return f"other users can write to {place} (group {_group(found.st_gid)})"
    return ""


def _safe() -> set[int]:
    return {0, os.geteuid()}


def _alone(gid: int) -> bool:
    """Whether a group has nobody but the caller and root in it, as a user's own group where the
    umask is 002.
    """
    try:
        members = {pwd.getpwnam(name).pw_uid for name in grp.getgrgid(gid).gr_mem}
    except KeyError:  # nobody has written down who is in it
        return False
    return members | {user.pw_uid for user in pwd.getpwall() if user.pw_gid == gid} <= _safe()


def _user(uid: int) -> str:
    try:
        return f"{pwd.getpwuid(uid).pw_name} (uid {uid})"
    except KeyError:
        return f"uid {uid}"


def _group(gid: int) -> str:
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)
