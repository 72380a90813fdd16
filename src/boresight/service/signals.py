"""SIGTERM and SIGINT end a live run at the next turn of its loop, with everything closed and counted."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def until_signalled() -> Iterator[Callable[[], bool]]:
    """Give a function that says whether either signal has come; a second one ends the process at once."""
    came = threading.Event()

    def note(number: int, _: Any) -> None:
        if came.is_set():
            raise KeyboardInterrupt
        came.set()

    if threading.current_thread() is not threading.main_thread():
        yield came.is_set
        return
    before = {number: signal.signal(number, note) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield came.is_set
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
