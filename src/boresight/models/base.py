"""What every built-in sensor model shares: where it stands, what it measures, and the kernel that does the work."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from boresight.errors import UserError
from boresight.kernels import observation
from boresight.kernels.measurement import measure
from boresight.models import check
from boresight.types.enums import N_COMPONENTS, Component
from boresight.types.sensor import FloatArray


class SensorPose(NamedTuple):
    """Where a sensor is and how its axes are turned, in world ENU; the default stands north-aligned at the origin."""

    position: FloatArray = np.zeros(3)  # (3,) m
    velocity: FloatArray = np.zeros(3)  # (3,) m/s
    enu_from_sensor: FloatArray = np.eye(3)  # (3, 3) from the sensor's east/north/up-like axes


AT_ORIGIN = SensorPose()
NOT_MEASURED = np.full(N_COMPONENTS, np.nan)


class KernelSensor:
    """The one abstract level of sensor models: components and context (see kernels.observation), and the methods.

    A subclass is final: a frozen dataclass whose `__post_init__` calls `describe`.
    """

    components: tuple[Component, ...]  # measured, ascending: the order of every measurement
    context: FloatArray  # (66,) what the kernel wants to know
    separable: bool  # components can be taken one at a time: in space, noise not correlated, not the tangent form
    kernel = staticmethod(observation.observe)
    pose: SensorPose
    dimensions: int

    @property
    def dimension(self) -> int:
        """Number m of measured components."""
        return len(self.components)

    def at(self, pose: SensorPose) -> Self:
        """Return the same sensor at another pose: the own ship moves."""
        context = self.context.copy()
        context[observation.POSITION : observation.NOISE] = _place(pose)
        moved = object.__new__(type(self))
        moved.__dict__.update(self.__dict__)
        object.__setattr__(moved, "pose", pose)
        object.__setattr__(moved, "context", context)
        return moved

    def innovation(self, z: FloatArray, x: FloatArray) -> FloatArray:
        """Return z - h(x) (m,), angles wrapped; NaN where not measured or not defined at `x`."""
        return self.linearise(z, x)[0]

    def h(self, x: FloatArray) -> FloatArray:
        """Return the noise-free measurement (m,) of the state `x`; directions that are not defined are zero."""
        place, d = self.context, int(self.context[observation.DIMENSIONS])
        p, v, out = np.zeros(3), np.zeros(3), np.empty(N_COMPONENTS)
        p[:d], v[:d] = x[:d], x[d : 2 * d]
        rotation = place[observation.ROTATION : observation.NOISE].reshape(3, 3)
        measure(p, v, place[observation.POSITION :][:3], place[observation.VELOCITY :][:3], rotation, out, _scratch())
        return out[list(self.components)]

    def H(self, x: FloatArray) -> FloatArray:
        """Return ∂h/∂x (m, n); NaN in the rows that are not defined at `x`."""
        return self.linearise(np.zeros(self.dimension), x)[1]

    def R(self, x: FloatArray) -> FloatArray:
        """Return the noise covariance (m, m)."""
        index = list(self.components)
        return self.context[observation.NOISE :].reshape(7, 7)[np.ix_(index, index)]

    def columns(self, z: FloatArray) -> FloatArray:
        """Return the measured components `z` (m,) spread over the 7 columns of `Component`, NaN elsewhere."""
        if np.shape(z) != (self.dimension,):
            names = ", ".join(c.name.lower() for c in self.components)
            raise UserError(f"the measurement must hold {names}: shape ({self.dimension},), not {np.shape(z)}")
        out = NOT_MEASURED.copy()
        try:
            out[list(self.components)] = z
        except (TypeError, ValueError):
            raise UserError(f"the measurement must be numbers, not {z!r}") from None
        if out[Component.RANGE] < 0.0 or np.isinf(out).any():
            raise UserError(f"the measurement holds an infinite number or a negative range: {z!r}")
        return out

    def linearise(self, z: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the innovation (m,) and H (m, n), NaN in rows that `z` does not hold or that `x` leaves undefined."""
        x = np.ascontiguousarray(x, dtype=float)
        y, H, rows = np.empty(N_COMPONENTS), np.empty((N_COMPONENTS, len(x))), np.empty(N_COMPONENTS, np.int64)
        m = observation.fill(x, self.columns(z), self.context, y, H, rows)
        y_out, H_out = np.full(self.dimension, np.nan), np.full((self.dimension, len(x)), np.nan)
        for i in range(m):
            at = self.components.index(rows[i])
            y_out[at], H_out[at] = y[i], H[i]
        return y_out, H_out


def _scratch() -> FloatArray:
    return np.empty((N_COMPONENTS, 6))


def _place(pose: SensorPose) -> FloatArray:
    place = np.concatenate((pose.position, pose.velocity, np.ravel(pose.enu_from_sensor)))
    if place.shape != (15,) or not np.isfinite(place).all():
        raise UserError("a sensor pose is position (3,), velocity (3,), enu_from_sensor (3, 3), all finite")
    return place


def describe(
    sensor: KernelSensor,
    sigmas: dict[Component, float | None],
    covariance: FloatArray | None,
    dimensions: int,
    tangent: bool = False,
) -> None:
    """Validate a sensor model's fields and set its components and context; raises UserError in one clear line."""
    check.spatial(dimensions)
    for component, sigma in sigmas.items():
        check.positive(f"sigma_{component.name.lower()}", sigma)
    components = tuple(sorted(c for c, sigma in sigmas.items() if sigma is not None))
    if not components:
        raise UserError("the sensor measures nothing: give at least one sigma")
    context = np.zeros(observation.CONTEXT_SIZE)
    noise = context[observation.NOISE :].reshape(7, 7)
    index = np.array(components)
    if covariance is None:
        noise[index, index] = [sigmas[c] ** 2 for c in components]  # type: ignore[operator]
    else:
        noise[np.ix_(index, index)] = check.covariance("the sensor's covariance", covariance, len(components))
    context[observation.DIMENSIONS] = dimensions
    context[observation.TANGENT] = tangent
    context[observation.POSITION : observation.NOISE] = _place(sensor.pose)
    object.__setattr__(sensor, "components", components)
    object.__setattr__(sensor, "context", context)
    alone = not tangent and dimensions == 3 and np.count_nonzero(noise) == len(components)
    object.__setattr__(sensor, "separable", alone)
