"""Compiled kernels: float64 arrays in and out. Importing this makes sure that there is a folder to cache them in."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from typing import Any

import numba
from numba import njit

from boresight.errors import UserError

config: Any = numba.config


def _probe() -> None:
    """What Numba is asked to cache, to see whether it can."""


def _ensure_cache() -> None:
    """Where no cache folder can be written (Numba raises then), take a temporary one for this process and its children.

    Numba tries NUMBA_CACHE_DIR, then __pycache__ beside the kernels, then the user's cache folder.
    """
    try:
        njit(cache=True)(_probe)
    except (RuntimeError, OSError):
        try:
            folder = tempfile.mkdtemp(prefix="boresight-kernels-")
        except OSError:
            raise UserError(
                "no folder can be written to keep compiled kernels in: set NUMBA_CACHE_DIR to one that can"
            ) from None
        atexit.register(_remove, folder, os.getpid())
        os.environ["NUMBA_CACHE_DIR"] = config.CACHE_DIR = folder
        print(
            "boresight: no cache folder can be written, so kernels are compiled anew for this process; "
            "set NUMBA_CACHE_DIR to one that can",
            file=sys.stderr,
            flush=True,
        )


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:  # not in a forked child
        shutil.rmtree(folder, ignore_errors=True)


if not config.DISABLE_JIT:
    _ensure_cache()
