"""Logs of live runs as commands open them."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from boresight.errors import UserError
from boresight.io.files import holds_others
from boresight.io.livelog import (
    MARKER,
    SETTINGS,
    SITE,
    LogTable,
    LogWriter,
    create_log,
    is_log,
    segment_name,
    segments_of,
)
from boresight.service.restart import NAME
from boresight.service.sockets import Input


def new_log(folder: Path, site: str, settings: str, force: bool, about: LogTable) -> LogWriter:
    """Begin a log; an existing one needs `force`. Raises UserError."""
    if folder.exists():
        inside = folder.is_dir() and any(folder.iterdir())
        if not folder.is_dir() or (inside and not is_log(folder)):
            raise UserError(f"{folder}: holds something else than a log; choose another folder")
        if inside and not force:
            raise UserError(f"{folder}: the log exists; give --force to replace it, or another folder")
        ours = {MARKER, SITE, SETTINGS, NAME, *map(segment_name, segments_of(folder))}
        others = sorted(p.name for p in folder.iterdir() if p.name not in ours and not p.name.startswith(f".{NAME}."))
        if others:
            raise UserError(f"{folder}: {holds_others(others)}")
        shutil.rmtree(folder)
    return create_log(folder, site, settings, about)


def said_ready(inputs: Sequence[Input]) -> None:
    """Say on standard error that everything is loaded and open."""
    print(f"boresight: listening on {', '.join(one.name for one in inputs) or 'nothing'}", file=sys.stderr, flush=True)
