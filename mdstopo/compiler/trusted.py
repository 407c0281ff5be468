"""Folders and files that code may be loaded from: those that nobody else can write to.

What lies in the cache is run (machine code) or unpickled, so whoever can put a file there can do all that the user can.
Owners that are trusted: this user, root, and the owner of the topmost folder, who is root outside of a container.
"""

import contextlib
import os
import stat
from pathlib import Path


class NotOursError(OSError):
    """A file that is not to be written to; a clause that says why."""


def is_private(folder: Path) -> bool:
    """Whether nobody else can put or replace anything in a folder, nor any folder above it.

    folder: resolved, without symbolic links. Above it, a folder that others may write to counts where it has the sticky
    bit: there (/tmp) nobody can rename what belongs to someone else.
    """
    try:
        own = folder.lstat()
        above = [each.lstat() for each in folder.parents]
    except OSError:
        return False
    if not stat.S_ISDIR(own.st_mode) or not _is_ours(own):
        return False
    return all(_is_ours(each) or (_is_trusted(each) and bool(each.st_mode & stat.S_ISVTX)) for each in above)


def make_private(folder: Path) -> bool:
    """Make a folder that only its owner can enter, where there is none; whether it is private now."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700)
    except OSError:
        return False
    return is_private(folder)


def read_private(path: Path) -> bytes | None:
    """The contents of a file that nobody else could have written; nothing where there is none."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError):
        return None
    with os.fdopen(descriptor, "rb") as stream:
        try:
            state = os.fstat(descriptor)
            return stream.read() if stat.S_ISREG(state.st_mode) and _is_ours(state) else None
        except OSError:
            return None


def write_private(path: Path, pieces: list[bytes]) -> bool:
    """Put a file in place, whole or not at all, that only its owner may change; whether that went well."""
    temporary = path.with_name(f"{path.name[:40]}.{os.getpid()}-{os.urandom(4).hex()}.tmp")
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.writelines(pieces)
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError:
        return False
    return True


def open_lock(path: Path) -> int:
    """The descriptor of a lock file, made where there is none: never that of a file that a link points to.

    Raises NotOursError where it is a link, a pipe, another user's, or has a second name, OSError where it cannot be
    opened.
    """
    if path.is_symlink():
        raise NotOursError("it is a symbolic link, which is not followed; remove it")
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    state = os.fstat(descriptor)
    if not stat.S_ISREG(state.st_mode) or state.st_uid != os.geteuid() or state.st_nlink > 1:
        os.close(descriptor)
        raise NotOursError("it is no plain file of this user with a single name; remove it")
    return descriptor


def _is_trusted(state: os.stat_result) -> bool:
    """Owned by this user, by root, or by whom root appears as: in some containers the topmost folder is no root's."""
    return state.st_uid in (0, os.geteuid(), os.stat("/").st_uid)


def _is_ours(state: os.stat_result) -> bool:
    """Owned by this user or root, and writable by no one else."""
    if not _is_trusted(state) or state.st_mode & stat.S_IWOTH:
        return False
    return not state.st_mode & stat.S_IWGRP or _is_own_group(state.st_gid)


def _is_own_group(number: int) -> bool:
    """Whether a group is this user's own, as many systems make one for each user: its rights are the user's."""
    if number != os.getegid():
        return False
    import grp
    import pwd

    try:
        group = grp.getgrgid(number)
        user = pwd.getpwuid(os.geteuid()).pw_name
    except (KeyError, OSError):
        return False
    return group.gr_name == user and set(group.gr_mem) <= {user}
