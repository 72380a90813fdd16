"""Whether the tracker's kernels lie compiled in Numba's cache."""

from __future__ import annotations

import os
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
