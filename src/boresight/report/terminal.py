"""A plan view in a terminal: braille dots, two across and four down in every cell."""

from __future__ import annotations

import colorsys

import numpy as np
from rich.text import Text

from boresight.report.scene import Frame
from boresight.types import FloatArray

BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


class Plan:
    """A character plan of `columns` × `lines` cells over west, east, south, north (m), equally scaled."""

    def __init__(self, columns: int, lines: int, bounds: tuple[float, float, float, float]) -> None:
        west, east, south, north = bounds
        self.columns, self.lines = columns, lines
        self.scale = min(2 * columns / (east - west), 4 * lines / (north - south))  # dots per metre
        self.x, self.y = 0.5 * (west + east), 0.5 * (south + north)
        self.dots = np.zeros((lines, columns), dtype=np.int64)
        self.style: dict[tuple[int, int], str] = {}
        self.letters: dict[tuple[int, int], str] = {}

    def _place(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        return (
            np.round(self.columns + (xy[:, 0] - self.x) * self.scale).astype(np.int64),
            np.round(2 * self.lines - (xy[:, 1] - self.y) * self.scale).astype(np.int64),
        )

    def points(self, xy: FloatArray, style: str) -> None:
        """Set one dot per position (k, 2)."""
        x, y = self._place(xy)
        inside = (x >= 0) & (x < 2 * self.columns) & (y >= 0) & (y < 4 * self.lines)
        for i, j in zip(x[inside].tolist(), y[inside].tolist(), strict=True):
            cell = (j // 4, i // 2)
            self.dots[cell] |= BITS[j % 4, i % 2]
            self.style[cell] = style

    def line(self, xy: FloatArray, style: str) -> None:
        """Set the dots along a path (k, 2)."""
        if len(xy) < 2:
            return self.points(xy, style)
        steps = np.maximum(np.ceil(np.abs(np.diff(xy, axis=0)).max(axis=1) * self.scale), 1).astype(np.int64)
        index = np.repeat(np.arange(len(steps)), steps)
        part = (np.arange(len(index)) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[index]
        dense = xy[index] + part[:, None] * (xy[index + 1] - xy[index])
        return self.points(np.concatenate([dense, xy[-1:]]), style)

    def word(self, xy: FloatArray, text: str, style: str) -> None:
        """Write `text` beside a position (2,)."""
        x, y = self._place(xy[None, :])
        row, column = int(y[0]) // 4, int(x[0]) // 2
        if not 0 <= row < self.lines or not 0 <= column < self.columns:
            return
        for k, letter in enumerate(text[: self.columns - column]):
            self.letters[row, column + k] = letter
            self.style[row, column + k] = style

    def text(self) -> Text:
        """Return the plan as rich text."""
        out = Text(no_wrap=True, overflow="crop")
        for row in range(self.lines):
            for column in range(self.columns):
                cell = (row, column)
                letter = self.letters.get(cell) or (chr(0x2800 + int(self.dots[cell])) if self.dots[cell] else " ")
                out.append(letter, self.style.get(cell, ""))
            out.append("\n")
        return out


def track_style(key: int) -> str:
    """Return a colour of its own for a track: steps of the golden angle around the colour circle."""
    red, green, blue = colorsys.hls_to_rgb((key * 137.508 % 360.0) / 360.0, 0.55, 0.7)
    return f"bold #{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"


def draw(frame: Frame, start: float, bounds: tuple[float, float, float, float], columns: int, lines: int) -> Text:
    """Return one frame as text of `columns` × `lines` cells, the first line a heading."""
    plan = Plan(columns, lines - 1, bounds)
    for points in frame.points:
        plan.points(points, "red")
    for path in frame.platforms:
        plan.line(path.xy, "bright_black")
        plan.word(path.xy[-1], f"^{path.name}", "bright_black")
    for path in frame.truth:
        plan.line(path.xy, "white")
    for path in frame.tracks:
        plan.line(path.xy, track_style(path.key))
        plan.word(path.xy[-1], f"{path.name}{'?' if path.coasting else ''}", track_style(path.key))
    head = f"{frame.t - start:8.1f} s   {len(frame.tracks)} tracks, {len(frame.truth)} targets   north up"
    return Text(head[:columns] + "\n") + plan.text()
