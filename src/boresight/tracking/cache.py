"""Whether the tracker's kernels lie compiled in Numba's cache, and how they get there while something else goes on."""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any


def compiled() -> bool:
    """Return whether a compiled tracker kernel is in the cache (or nothing is compiled at all, or nobody can tell)."""
    from boresight.kernels.tracker_window import advance

    kernel: Any = advance

    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return True
    try:
        index = kernel._cache._cache_file._index_path
    except AttributeError:
        return True
    return bool(os.path.exists(index))


@contextlib.contextmanager
def told_of_compiling(say: Callable[[str], None]) -> Iterator[None]:
    """Call `say` with the name of each kernel that Numba begins to compile while the body runs, callers before callees.

    What comes from the cache is not compiled, however long that takes.
    """
    from numba.core.event import Event, Listener, install_listener

    class Told(Listener):
        def on_start(self, event: Event) -> None:
            kernel = event.data["dispatcher"].py_func
            say(f"{kernel.__module__.removeprefix('boresight.')}.{kernel.__name__}")

        def on_end(self, event: Event) -> None:
            pass

    with install_listener("numba:compile", Told()):
        yield


@contextlib.contextmanager
def seldom_collected() -> Iterator[None]:
    """Let Python look for cyclic garbage seldom while the body runs.

    A compiler keeps nearly all that it makes until it is through; to look it over for garbage every 700 objects is a
    tenth of the time that the tracker takes to compile. Costs 40 MB.
    """
    before = gc.get_threshold()
    if gc.isenabled() and before[0] > 0:
        gc.set_threshold(max(before[0], 200_000), 1000, 1000)
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextlib.contextmanager
def compiling_beside(dimensions: int, blob_shares: tuple[float, ...] = (0.0,)) -> Iterator[bool]:
    """Compile the tracker in a second process while the body runs, unless that is done; gives whether it is not.

    The kernel that looks for second targets in a blob (a share above 0) is another than the plain one. Leaves when both
    processes are through. Should the second process fail, the kernels are compiled when they are called. The body,
    which may compile other kernels, runs `seldom_collected`.
    """
    if compiled():
        yield False
        return
    command = warming(dimensions, blob_shares)
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with seldom_collected():
            yield True
        child.wait()
    finally:
        child.kill()
        child.wait()


def warming(dimensions: int, blob_shares: tuple[float, ...] = (0.0,)) -> list[str]:
    """Return the command that does what `warm` does in a process of its own."""
    return [sys.executable, "-c", f"from boresight.tracking.warm import warm; warm({dimensions}, {blob_shares})"]
