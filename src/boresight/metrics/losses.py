"""What became of reports that no track used: counted by sensor and reason, in one line each."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import numpy as np

from boresight.types import FATES, DecisionRows, Fate, Recording

LOST = (Fate.LATE, Fate.SCREENED, Fate.OUT_OF_COVERAGE, Fate.UNUSED)  # not one of these was asked of a track


def losses(recording: Recording, decisions: DecisionRows) -> list[dict[str, Any]]:
    """Return one row for each sensor and reason: `sensor`, `reason`, `reports` lost, `of` how many."""
    out = []
    lost = np.isin(decisions.fate, [FATES.index(f) for f in LOST])
    for i, sensor in enumerate(recording.sensors):
        mine = recording.detections.sensor == i
        counted = Counter((int(decisions.fate[k]), _kind(decisions.reason[k])) for k in np.flatnonzero(mine & lost))
        for (code, reason), n in counted.most_common():
            fate = FATES[code]
            out.append(
                {
                    "item": "lost",
                    "sensor": sensor.id,
                    "fate": str(fate),
                    "reason": reason,
                    "reports": n,
                    "of": int(mine.sum()),
                }
            )
    return out


def _kind(reason: Any) -> str:
    """A reason without the numbers of its row."""
    return re.sub(r"its stamp t_s = \S+( \(.*? UTC\))?", "its stamp", str(reason or "")).split(":")[0]


def loss_lines(recording: Recording, decisions: DecisionRows) -> list[str]:
    """Return the losses as lines for people."""
    return [
        f"{row['sensor']}: {row['reports']} of {row['of']} reports not used ({row['fate']}): {row['reason']}"
        for row in losses(recording, decisions)
    ]
