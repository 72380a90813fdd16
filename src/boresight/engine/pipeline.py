"""Stages in a row before the tracker; knows their protocol and nothing else of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boresight.stages.protocol import Belief, Note, Stage
from boresight.types import FATES, NO_TRACK, DecisionRows, Fate, Scan

DEPTH = 3  # stages that make values


@dataclass(frozen=True, slots=True, eq=False)
class Pipeline:
    """Stages, in order; without any, looks reach the tracker as they came."""

    stages: tuple[Stage[Any], ...] = ()

    def init(self) -> list[Any]:
        """Return the stages' states before the first look."""
        return [stage.init() for stage in self.stages]

    def step(self, state: list[Any], scan: Scan, belief: Belief) -> tuple[list[Any], tuple[Scan, ...], list[Note]]:
        """Take one look through all stages; returns the looks for the tracker, and notes."""
        scans: tuple[Scan, ...] = (scan,)
        notes: list[Note] = []
        for i, stage in enumerate(self.stages):
            out: list[Scan] = []
            for one in scans:
                state[i], stepped = stage.step(state[i], one, belief)
                out += [replace(s, t_recv=max(s.t_recv, scan.t_recv)) for s in stepped.scans]
                notes += stepped.notes
            scans = tuple(out)
        return state, scans, notes

    def finish(self, state: list[Any]) -> list[Note]:
        """Return what became of the reports still held: no track may know of them, or an end would tell the future."""
        return [note for stage, one in zip(self.stages, state, strict=True) for note in stage.finish(one)]


def with_notes(decisions: DecisionRows, notes: Sequence[Note]) -> DecisionRows:
    """Give the rows that a stage took, or that went into a value, their fate and reason.

    Further columns: `value_row`, the row under which the value with this report in it reached the tracker (null where
    the report went alone or nowhere), and `value_reports`, how many reports that value stands for. A report that went
    into a value has the track of that value; NIS stands with the value's own row.
    """
    fate, track, reason = decisions.fate.copy(), decisions.track_id.copy(), decisions.reason.copy()
    value = np.arange(len(decisions))  # the row that each report went on under
    for note in notes:
        if note.fate == Fate.ALIGNED and note.value_row == note.row:
            continue  # it stands for its value: the tracker's word on that is its fate
        fate[note.row], reason[note.row] = FATES.index(note.fate), note.reason
        if note.fate == Fate.ALIGNED:
            value[note.row] = note.value_row
        else:
            track[note.row] = NO_TRACK
    for _ in range(DEPTH):  # a value may have gone into another
        value = value[value]
    inside = np.flatnonzero(value != np.arange(len(value)))
    track[inside] = track[value[inside]]
    lost = inside[np.isin(fate[value[inside]], [FATES.index(f) for f in (Fate.UNUSED, Fate.SCREENED, Fate.LATE)])]
    fate[lost], reason[lost] = fate[value[lost]], reason[value[lost]]
    count = np.bincount(value, minlength=len(value))[value]
    several = count > 1
    extra = {"value_row": np.where(several, value, np.nan), "value_reports": np.where(several, count, np.nan)}
    return replace(decisions, fate=fate, track_id=track, reason=reason, extra=decisions.extra | extra)
