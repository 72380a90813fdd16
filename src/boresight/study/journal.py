"""What has been done of a study, line by line, so that a run that is killed can go on where it was."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from boresight.errors import UserError
from boresight.io.files import reason

JOURNAL = "runs.jsonl"


class Journal:
    """An open journal: `rows` are those done before; `add` writes one more, whole or not at all when read again."""

    def __init__(self, folder: Path, fingerprint: str) -> None:
        """Open or begin the journal of a folder; raises UserError where it is another study's or cannot be written."""
        self.path = folder / JOURNAL
        self.rows: list[dict[str, Any]] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
            whole = self._read(fingerprint) if self.path.exists() else 0
            self._file = self.path.open("r+b" if whole else "wb")
        except OSError as error:
            raise UserError(f"{self.path}: cannot be written ({reason(error)})") from None
        self._file.truncate(whole)
        self._file.seek(whole)
        if not whole:
            self._write({"study": fingerprint})

    def _read(self, fingerprint: str) -> int:
        """Read the whole lines; returns where the last one ends. A torn line at the end is done again."""
        whole, head = 0, None
        for line in self.path.read_bytes().splitlines(keepends=True):
            try:
                row = json.loads(line)
            except ValueError:
                break
            if not line.endswith(b"\n"):
                break
            whole += len(line)
            if head is None:
                head = row
            else:
                self.rows.append(row)
        if head is not None and head != {"study": fingerprint}:
            raise UserError(f"{self.path.parent}: holds runs of another study; give --force, or another output folder")
        return whole

    def add(self, row: dict[str, Any]) -> None:
        """Keep one row."""
        self.rows.append(row)
        self._write(row)

    def _write(self, row: dict[str, Any]) -> None:
        try:
            self._file.write(json.dumps(row).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise UserError(f"{self.path}: cannot be written ({reason(error)}); the runs before are kept") from None

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
