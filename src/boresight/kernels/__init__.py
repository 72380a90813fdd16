"""Compiled kernels: float64 arrays in and out. Importing this makes sure that their cache is writable and true."""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import shutil
import sys
import tempfile
from pathlib import Path
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
        _drop_stale(njit(cache=True)(_probe))
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


def _drop_stale(probe: Any) -> None:
    """Drop what is cached where any kernel's file has changed since.

    Numba looks at a function's own file only: after an update it would join a caller compiled before with a callee of
    now, whose arguments may mean something else.
    """
    here = Path(__file__).parent
    files = sorted((f.name, f.stat().st_size, f.stat().st_mtime_ns) for f in here.glob("*.py"))
    stamp = hashlib.sha256(repr(files).encode()).hexdigest()
    folder = Path(probe._cache.cache_path)
    note = folder / "kernels.stamp"
    if note.is_file() and note.read_bytes() == stamp.encode():
        return
    folder.mkdir(parents=True, exist_ok=True)
    for index in folder.glob("*.nbi"):
        index.unlink(missing_ok=True)
    fresh = folder / f"kernels.stamp.{os.getpid()}"
    fresh.write_text(stamp)
    fresh.replace(note)


def _heal() -> None:
    """Make Numba take a kernel that lies damaged in the cache as one that is not there, and go on where it cannot save.

    A run that is killed or a disk that is full leaves files cut short; Numba would raise whatever unpickling them does.
    """
    from numba.core import caching

    cache: Any = caching.Cache
    load, save = cache.load_overload, cache.save_overload
    told: list[str] = []

    def load_overload(self: Any, sig: Any, context: Any) -> Any:
        try:
            return load(self, sig, context)
        except Exception:
            if not _ours(self):
                raise
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self: Any, sig: Any, data: Any) -> None:
        try:
            try:
                save(self, sig, data)
            except OSError:
                raise
            except Exception:  # of the index that it adds to
                if not _ours(self):
                    raise
                self.flush()
                save(self, sig, data)
        except OSError as error:
            if not _ours(self):
                raise
            if not told:
                told.append(str(error.strerror or error).lower())
                print(f"boresight: compiled kernels cannot be kept ({told[0]})", file=sys.stderr, flush=True)

    cache.load_overload, cache.save_overload = load_overload, save_overload


def _ours(cache: Any) -> bool:
    return str(getattr(cache._py_func, "__module__", "")).startswith("boresight.")


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:  # not in a forked child
        shutil.rmtree(folder, ignore_errors=True)


if not config.DISABLE_JIT:
    _heal()
    _ensure_cache()
