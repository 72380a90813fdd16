"""Smoothing as a stage: the newest value of a polynomial through an object's last reports."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.align.smooth import polynomial_weights
from boresight.errors import UserError
from boresight.stages.follow import distances, pair
from boresight.stages.protocol import Belief, Note, Stepped
from boresight.stages.scene import Scene, local, spread
from boresight.types import Component, FloatArray, Scan


@dataclass(slots=True, eq=False)
class Trail:
    """The last reports of one object as one sensor sees it, world axes."""

    t: list[float]
    xyz: list[FloatArray]  # (3,) positions or unit directions


@dataclass(frozen=True, slots=True, eq=False)
class SmoothStage:
    """Replace every report by the polynomial of `order` through the last `samples` of its object, at its own time.

    The end row of Savitzky–Golay, on world positions or direction vectors. Neighbouring values share reports and are
    correlated; each is given the covariance of the one report that is new in it (times the noise gain, should that be
    above 1). The others counted before. At low frequency, which is what a track sees of it, that is exact: the weights
    add to one. A report without `order + 2` of its object goes on as it is.
    """

    scene: Scene
    sensors: frozenset[int]
    speed: float  # m/s
    rate: float  # rad/s
    samples: int = 7
    order: int = 3
    gate: float = 4.0
    memory: float = 12.0  # s

    def __post_init__(self) -> None:
        if not (1 <= self.order <= 5 and self.samples >= self.order + 2):
            raise UserError("smooth: order is 1 to 5, and samples at least order + 2")

    def init(self) -> dict[int, list[Trail]]:
        """Return the state before the first look."""
        return {}

    def step(self, state: dict[int, list[Trail]], scan: Scan, belief: Belief) -> tuple[Any, Stepped]:
        """Smooth a look's reports."""
        if scan.sensor not in self.sensors or len(scan.t) == 0:
            return state, Stepped((scan,))
        t = self.scene.valid(scan)
        place = self.scene.place(scan.sensor, t, scan.t_recv)
        xyz, directions = local(scan.z)
        if place is None or (directions.any() and not directions.all()):
            return state, Stepped((scan,))
        world = np.einsum("kij,kj->ki", place.axes, xyz)
        origin = np.zeros_like(place.position) if directions.all() else place.position
        world = world + origin
        sigma = spread(scan.z, scan.covariance, xyz)
        trails = [h for h in state.get(scan.sensor, []) if float(t.max()) - h.t[-1] <= self.memory]
        reach = self.rate if directions.all() else self.speed
        owner = self._owners(trails, t, world, sigma, reach)
        z, R = scan.z.copy(), scan.covariance.copy()
        for i, trail in enumerate(owner):
            if trail is None:
                continue
            trail.t, trail.xyz = [*trail.t, float(t[i])][-self.samples :], [*trail.xyz, world[i]][-self.samples :]
            if len(trail.t) < self.order + 2:
                continue
            w = polynomial_weights(trail.t, [float(t[i])], self.order)[0]
            moved = place.axes[i].T @ (w @ np.array(trail.xyz) - origin[i])
            _write(z[i], moved, bool(directions[i]))
            R[i] *= max(1.0, float(w @ w))
        state[scan.sensor] = trails
        out = Scan(scan.sensor, scan.t_look, scan.t_recv, scan.t, z, R, scan.row, scan.empty_rows, scan.address)
        return state, Stepped((out,))

    def finish(self, state: dict[int, list[Trail]]) -> tuple[Note, ...]:
        """Nothing is held."""
        return ()

    def _owners(
        self, trails: list[Trail], t: FloatArray, world: FloatArray, sigma: FloatArray, reach: float
    ) -> list[Trail | None]:
        """The trail that each report continues or begins; None for one that is out of order."""
        out: list[Trail | None] = [None] * len(t)
        taken = np.full(len(t), -1)
        late = np.zeros(len(t), dtype=bool)
        if trails:
            age = t[:, None] - np.array([h.t[-1] for h in trails])[None, :]
            limit = reach * age + self.gate * math.sqrt(2.0) * sigma[:, None]
            taken = pair(distances(world, np.array([h.xyz[-1] for h in trails])), np.where(age > 0.0, limit, -1.0))
            late = (age <= 0.0).all(axis=1)
        for i in range(len(t)):
            if taken[i] >= 0:
                out[i] = trails[taken[i]]
            elif not late[i]:
                out[i] = Trail([], [])
        trails.extend(h for i, h in enumerate(out) if h is not None and taken[i] < 0)
        return out


def _write(z: FloatArray, xyz: FloatArray, direction: bool) -> None:
    """Put a position or direction in sensor axes into the components that were measured."""
    rho = math.hypot(xyz[0], xyz[1])
    values = {
        Component.RANGE: math.hypot(rho, xyz[2]),
        Component.AZIMUTH: math.atan2(xyz[0], xyz[1]),
        Component.ELEVATION: math.atan2(xyz[2], rho),
        Component.EAST: xyz[0],
        Component.NORTH: xyz[1],
        Component.UP: xyz[2],
    }
    for component, value in values.items():
        if math.isfinite(z[component]) and not (direction and component == Component.RANGE):
            z[component] = value
