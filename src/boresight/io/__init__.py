"""Files in and out: recordings, results, imports and exports. Nothing else in the package below level 7 does I/O."""

from boresight.io.recording import read_recording, write_recording
from boresight.io.scans import iter_scans, selected

__all__ = ["iter_scans", "read_recording", "selected", "write_recording"]
