"""Files in and out: recordings, results, imports and exports. Nothing else in the package below level 7 does I/O."""

from boresight.io.files import check_output, output_folder
from boresight.io.recording import read_recording, write_recording
from boresight.io.results import read_results, write_results
from boresight.io.scans import iter_scans, selected

__all__ = [
    "check_output",
    "iter_scans",
    "output_folder",
    "read_recording",
    "read_results",
    "selected",
    "write_recording",
    "write_results",
]
