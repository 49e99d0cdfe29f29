"""The one error of the set-up, and the words for what an operating system refuses."""

from __future__ import annotations

import errno
import shutil
import tempfile


class SetUpError(Exception):
    """The environment cannot be made. The text is one line: what is wrong, and how to mend it.

    `details` is shown before it: the end of what a compiler or an installer said, where that is what is to be mended.
    """

    def __init__(self, line: str, details: str = "") -> None:
        super().__init__(line)
        self.details = details


NO_SPACE = (errno.ENOSPC, errno.EDQUOT)
NOT_WRITABLE = (errno.EACCES, errno.EPERM, errno.EROFS)


def from_os_error(error: OSError, root: str) -> SetUpError:
    """The line for an OSError met while the set-up wrote into the checkout `root`."""
    if error.errno in NO_SPACE:
        return no_space(root)
    if error.errno in NOT_WRITABLE:
        return not_writable(error.filename or root)
    where = f" ({error.filename})" if error.filename else ""
    return SetUpError(f"the set-up failed: {error.strerror or error}{where}. Mend that and start again.")


def no_space(root: str) -> SetUpError:
    """The line for a full disk; names what is free where the set-up writes."""
    places = sorted({str(root), tempfile.gettempdir()})
    free = ", ".join(f"{place}: {free_bytes(place) // 2**20} MiB free" for place in places)
    return SetUpError(f"no space left on the disk ({free}); the set-up needs about 1.5 GiB. Free some and start again.")


def not_writable(path: object) -> SetUpError:
    """The line for a place that refuses to be written."""
    return SetUpError(f"{path} is not writable; make it so, or clone into a directory of your own, and start again.")


def free_bytes(path: str) -> int:
    """Bytes that an ordinary user can still write at `path`; 0 where it cannot be asked."""
    try:
        return shutil.disk_usage(path).free
    except OSError:
        return 0
