"""Temporary files of a server lie in its data folder: what a killed server left there goes when the next one starts."""

import multiprocessing.util
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# The path of a socket may have 103 bytes on some systems; 32 of them are its own name and that of its folder.
LONGEST_FOLDER = 70


@contextmanager
def temporary_files_in(folder: Path) -> Iterator[None]:
    """Have this process, and those it starts from now on, make their temporary files in a folder (made if missing)."""
    folder.mkdir(parents=True, exist_ok=True)
    if len(os.fsencode(folder)) > LONGEST_FOLDER:
        # Sockets between processes are files, and their paths must be short: those stay in the system's folder.
        multiprocessing.util.get_temp_dir()
    before = os.environ.get("TMPDIR")
    os.environ["TMPDIR"], tempfile.tempdir = str(folder), None
    try:
        yield
    finally:
        if before is None:
            del os.environ["TMPDIR"]
        else:
            os.environ["TMPDIR"] = before
        tempfile.tempdir = None


def clear(folder: Path) -> int:
    """Remove what lies in a folder that nobody else uses; return how many files and folders were left there.

    What cannot be removed stays for the next time: a process of the dead server may be ending in it right now.
    """
    if not folder.is_dir():
        return 0
    left = list(folder.iterdir())
    for path in left:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
    return len(left)
