"""Work for the engine's workers: importable by a fresh process."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any


def square(task: int) -> dict[str, Any]:
    """Return the square."""
    return {"value": task * task}


def die_once(task: tuple[int, str]) -> dict[str, Any]:
    """Number 2 kills its own process, the first time."""
    number, marker = task
    if number == 2 and not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"value": number}


def die_always(task: int) -> dict[str, Any]:
    """Kill the own process."""
    os.kill(os.getpid(), signal.SIGKILL)
    return {"value": task}


def fail(task: int) -> dict[str, Any]:
    """Raise."""
    raise ValueError(f"no {task}")


def interrupted(task: int) -> dict[str, Any]:
    """Say what Ctrl-C would do here."""
    return {"ignored": signal.getsignal(signal.SIGINT) == signal.SIG_IGN}
