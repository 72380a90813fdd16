"""Which number a track goes by in what is written."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from boresight.types import NO_TRACK, FloatArray

MAX_ROW_GAP = 0.5  # s between two rows of one track id

IntArray = NDArray[np.int64]


@dataclass(slots=True, eq=False)
class Names:
    """Tracks that were ever shown, by the detection that began them."""

    given: int = 0  # numbers given out
    birth: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))  # (n,) ascending
    number: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))  # (n,) the newest
    last: FloatArray = field(default_factory=lambda: np.zeros(0))  # (n,) time of the newest row (s)

    def copy(self) -> Names:
        """Return an independent copy."""
        return Names(self.given, self.birth.copy(), self.number.copy(), self.last.copy())

    def of(self, birth: IntArray) -> IntArray:
        """Return the numbers (k,) of tracks by birth, NO_TRACK where a track was never shown."""
        at, known = self._find(birth)
        return np.where(known, self.number[at], NO_TRACK) if len(self.birth) else np.full(len(birth), NO_TRACK)

    def take(self, birth: IntArray, t: FloatArray) -> IntArray:
        """Return the numbers (k,) of rows in the order in which they are written.

        A live track has a row every half second; one that is shown again after longer begins anew.
        """
        order = np.argsort(birth, kind="stable")
        births, times = birth[order], t[order]
        begins = np.ones(len(births), np.bool_)
        begins[1:] = births[1:] != births[:-1]
        heads = np.flatnonzero(begins)
        at, known = self._find(births[heads])
        before = np.empty(len(times))
        before[1:] = times[:-1]
        before[heads] = -np.inf
        before[heads[known]] = self.last[at[known]]
        fresh = times - before > MAX_ROW_GAP
        number = np.zeros(len(times), np.int64)
        number[heads[known]] = self.number[at[known]]
        in_turn = np.zeros(len(times), np.bool_)
        in_turn[order] = fresh
        number[fresh] = (self.given + np.cumsum(in_turn))[order][fresh]
        self.given += int(in_turn.sum())
        source = np.maximum.accumulate(np.where(fresh | begins, np.arange(len(times)), 0))
        number = number[source]
        tails = np.append(heads[1:], len(times)) - 1
        self.number[at[known]], self.last[at[known]] = number[tails[known]], times[tails[known]]
        new = tails[~known]
        if len(new):
            place = np.searchsorted(self.birth, births[new])
            self.birth = np.insert(self.birth, place, births[new])
            self.number = np.insert(self.number, place, number[new])
            self.last = np.insert(self.last, place, times[new])
        out = np.empty(len(times), np.int64)
        out[order] = number
        return out

    def _find(self, birth: IntArray) -> tuple[IntArray, NDArray[np.bool_]]:
        if not len(self.birth):
            return np.zeros(len(birth), np.int64), np.zeros(len(birth), np.bool_)
        at = np.minimum(np.searchsorted(self.birth, birth), len(self.birth) - 1)
        return at, self.birth[at] == birth
