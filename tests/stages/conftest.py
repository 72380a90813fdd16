"""One radar and one infrared sensor at the site, one target or several, looks made by hand."""

from __future__ import annotations

import numpy as np

from boresight.types import Axes, Coverage, Scan, Sensor, SensorKind

AZ = 1


def sensor(name: str, kind: SensorKind, sigma: dict[int, float], **more: object) -> Sensor:
    values = np.full(7, np.nan)
    for component, value in sigma.items():
        values[component] = value
    return Sensor(name, kind, axes=Axes.SITE_ENU, sigma=values, coverage=Coverage(), **more)  # type: ignore[arg-type]


RADAR = sensor("radar", SensorKind.RADAR, {0: 5.0, 1: 0.01, 2: 0.01}, period=1.0)
IR = sensor("ir", SensorKind.INFRARED, {1: 0.002, 2: 0.002}, period=0.1)
BEARING = sensor("ir", SensorKind.INFRARED, {1: 0.002}, period=0.1, latency=0.3)


def look(
    number: int, one: Sensor, t: float, reports: list[dict[int, float]], row: int, recv: float | None = None
) -> Scan:
    """A look whose reports have the sensor's own noise; `t` is the stamp."""
    n = len(reports)
    z, R = np.full((n, 7), np.nan), np.full((n, 7, 7), np.nan)
    for i, report in enumerate(reports):
        for c, value in report.items():
            z[i, c] = value
        have = sorted(report)
        R[i][np.ix_(have, have)] = np.diag(one.sigma[have] ** 2)
    stamps = np.full(n, t)
    empty = () if n else (row,)
    return Scan(number, t, t if recv is None else recv, stamps, z, R, np.arange(row, row + n), empty)
