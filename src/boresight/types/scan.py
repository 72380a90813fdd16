"""One look of one sensor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from boresight.types.sensor import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One look of one sensor: its detections as columns, in the sensor's own axes, with the stamps as recorded.

    An empty scan (`len(t) == 0`) is information and is kept: `t_look` says when the sensor looked.

    Attributes:
        sensor: index into the recording's sensors.
        t_look: time of validity of the look (s): the middle of its detections, or the stamp of the empty row.
        t_recv: time of arrival (s) of the whole look.
        t: (n,) time of validity of each detection (s); the sensor's declared latency is not yet taken off.
        z: (n, 7) measured components, columns by `Component`; NaN where not measured (m, rad, m/s).
        covariance: (n, 7, 7) of the measured components, NaN elsewhere.
        row: (n,) row of each detection in the file; for an empty scan the rows that said so stand in `empty_rows`.
        address: (n,) codes of the detections' `source_id` (`address_code`), -1 where there is none; None: nowhere.
    """

    sensor: int
    t_look: float
    t_recv: float
    t: FloatArray
    z: FloatArray
    covariance: FloatArray
    row: NDArray[np.int64]
    empty_rows: tuple[int, ...] = ()
    address: NDArray[np.int64] | None = None


def addresses_of(scan: Scan) -> NDArray[np.int64]:
    """Return the codes (n,) of the detections' addresses, -1 where there is none."""
    return np.full(len(scan.t), -1, np.int64) if scan.address is None else scan.address


@lru_cache(maxsize=65536)
def address_code(word: str | None) -> int:
    """Return the code of a `source_id`: always the same number of 52 bits for the same word, -1 for None."""
    if word is None:
        return -1
    return int.from_bytes(blake2b(word.encode(), digest_size=8).digest()) >> 12
