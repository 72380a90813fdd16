"""The state of a live run beside its log, so that the next one goes on where it was: saved now and then, at once or
not at all, and brought up to the end of the log by replaying what came after it."""

from __future__ import annotations

import io
import json
import os
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight._version import __version__
from boresight.errors import UserError
from boresight.io.files import reason
from boresight.tracking.saved import Arrays, arrays_of_state, state_of_arrays
from boresight.tracking.tracker import Tracker, TrackerState

NAME = "state.npz"


class StateFile:
    """Writes the state into a log folder, beside the loop."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        for part in folder.glob(f".{NAME}.*"):  # of a run that was killed
            part.unlink(missing_ok=True)
        self.saved = self.errors = 0
        self.error = ""
        self._writing: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether the last state is still being written."""
        return self._writing is not None and self._writing.is_alive()

    def save(self, state: TrackerState, place: tuple[int, int], others: Mapping[str, Any], wait: bool = False) -> None:
        """Save the state with its `place` in the log (segment, offset), and the decoder's and navigation's beside."""
        arrays = {name: np.array(a) for name, a in arrays_of_state(state).items()}
        about = json.dumps({"version": __version__, "place": place, **others})
        self._writing = threading.Thread(target=self._write, args=(arrays, about), daemon=True)
        self._writing.start()
        if wait:
            self._writing.join()

    def _write(self, arrays: Arrays, about: str) -> None:
        part = self.path.with_name(f".{NAME}.{os.getpid()}")
        try:
            with part.open("wb") as file:
                np.savez(file, about=np.array(about), **arrays)  # type: ignore[arg-type]
                file.flush()
                os.fsync(file.fileno())
            part.replace(self.path)
            self.saved += 1
            self.error = ""
        except OSError as error:
            self.errors += 1
            self.error = reason(error)
            part.unlink(missing_ok=True)


def load_state(folder: Path, tracker: Tracker) -> tuple[TrackerState, tuple[int, int], dict[str, Any]] | None:
    """Return the state saved in a log folder, its place in the log and the others' state; None if there is none.

    Raises UserError for one that is damaged or of another tracker.
    """
    path = folder / NAME
    if not path.is_file():
        return None
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays: dict[str, NDArray[np.generic]] = {name: file[name] for name in file.files}
        about = json.loads(str(arrays.pop("about")))
        segment, offset = (int(number) for number in about["place"])
        if min(segment, offset) < 0:
            raise ValueError(about["place"])
    except Exception:  # whatever an archive reader stumbles over in bytes that are not an archive's
        raise UserError(
            f"{path}: the saved state is damaged; remove it, and the log is replayed from its beginning"
        ) from None
    try:
        return state_of_arrays(arrays, tracker), (segment, offset), about
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
