"""The one protocol of all stages: looks in order of arrival in, looks and notes out, state in and out."""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from boresight.types import Fate, FloatArray, Scan

S = TypeVar("S")


class Belief(NamedTuple):
    """What the tracker believes before a look: its tracks as straight lines, world ENU."""

    t: float  # s
    position: FloatArray  # (k, 3) m
    velocity: FloatArray  # (k, 3) m/s
    covariance: FloatArray  # (k, 3, 3) of the position at `t`, m²
    velocity_covariance: FloatArray  # (k, 3, 3) m²/s²


NOTHING_BELIEVED = Belief(0.0, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3, 3)))


class Note(NamedTuple):
    """What a stage made of one row of the detections.

    `value_row` is the row under which a value that holds this report went on (-1: none). A row that a stage passes on
    unchanged has no note; a row that stands for a value has one with its own row as `value_row`.
    """

    row: int
    fate: Fate
    reason: str
    value_row: int = -1


class Stepped(NamedTuple):
    """What one step of a stage gives: looks for the next stage, in order, and notes."""

    scans: tuple[Scan, ...]
    notes: tuple[Note, ...] = ()


class Stage(Protocol[S]):
    """Frozen configuration with `init` and `step`; nothing is hidden in it. A step may reuse its input state."""

    def init(self) -> S:
        """Return the state before the first look."""
        ...

    def step(self, state: S, scan: Scan, belief: Belief) -> tuple[S, Stepped]:
        """Take one look. Looks that a stage gives later carry the arrival of the look that set them free."""
        ...

    def finish(self, state: S) -> tuple[Note, ...]:
        """Say what became of the reports still held when the recording ends: they reach no track."""
        ...
