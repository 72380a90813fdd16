"""A camera: pixels against directions in its own forward, right, down axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.frames._columns import bad, columns, rows
from boresight.kernels import camera as kernel
from boresight.types.sensor import FloatArray


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole with Brown–Conrady distortion (coefficients in OpenCV's order k1, k2, p1, p2, k3).

    Pixels (px, py) run right and down; the centre of the first pixel is (0, 0). `width` and `height`, `fx`, `fy`,
    `cx`, `cy` are in pixels. Raises UserError for a size or focal length that is not positive.
    """

    width: float
    height: float
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width", "height", "fx", "fy"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise UserError(f"camera: {name} = {getattr(self, name)} must be positive")
        for name in ("cx", "cy", "k1", "k2", "p1", "p2", "k3"):
            if not math.isfinite(getattr(self, name)):
                raise UserError(f"camera: {name} is not finite")

    @property
    def parameters(self) -> FloatArray:
        """The (10,) parameters as `kernels.camera` takes them, with the radius at which the distortion folds over."""
        radial = np.array([7.0 * self.k3, 5.0 * self.k2, 3.0 * self.k1, 1.0])  # d/dr of r (1 + k1 r² + …), in r²
        roots = np.roots(radial)
        folds = roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > 0)]
        limit = float(folds.min()) if len(folds) else math.inf
        return np.array([self.fx, self.fy, self.cx, self.cy, self.k1, self.k2, self.p1, self.p2, self.k3, limit])


def camera_from_fov(width: float, height: float, horizontal_fov: float, vertical_fov: float | None = None) -> Camera:
    """Return an undistorted camera of a size (px) and full fields of view (rad), with its centre in the middle.

    Without `vertical_fov` pixels are square. f = (width / 2) / tan(fov / 2). The borders of the picture lie half a
    pixel outside the outermost centres. Raises UserError for a field of view outside (0, π).
    """
    for name, fov in (("horizontal", horizontal_fov), ("vertical", vertical_fov)):
        if fov is not None and not 0.0 < fov < math.pi:
            raise UserError(f"camera: {name} field of view of {math.degrees(fov):g}° must lie between 0 and 180°")
    fx = 0.5 * width / math.tan(0.5 * horizontal_fov)
    fy = fx if vertical_fov is None else 0.5 * height / math.tan(0.5 * vertical_fov)
    return Camera(width, height, fx, fy, 0.5 * (width - 1), 0.5 * (height - 1))


def pixel_from_direction(camera: Camera, direction: ArrayLike) -> FloatArray:
    """Return pixels (..., 2) of directions (..., 3) in forward, right, down axes (any length).

    Raises UserError for a direction behind the camera, one beyond the radius where the distortion folds over, and
    one whose pixel lies outside the picture (`visible` tells beforehand).
    """
    (f, r, d), shape = _directions(direction)
    px, py = kernel.pixel_from_direction(camera.parameters, f, r, d)
    seen = _inside(camera, px, py)
    if not seen.all():
        row = int(np.flatnonzero(~seen)[0])
        if not f[row] > 0:
            bounds = "in front of the camera"
        elif not np.isfinite(px[row]):
            bounds = "inside the radius where the lens distortion folds over"
        else:
            bounds = f"inside the picture; its pixel is ({px[row]:.2f}, {py[row]:.2f})"
        raise UserError(bad(bounds, row, [f[row], r[row], d[row]]))
    return np.stack([px, py], axis=-1).reshape(*shape, 2)


def visible(camera: Camera, direction: ArrayLike) -> NDArray[np.bool_]:
    """Return (...,) whether directions (..., 3) in forward, right, down axes have a pixel inside the picture."""
    (f, r, d), shape = _directions(direction)
    return _inside(camera, *kernel.pixel_from_direction(camera.parameters, f, r, d)).reshape(shape)


def direction_from_pixel(camera: Camera, px: ArrayLike, py: ArrayLike) -> FloatArray:
    """Return unit directions (..., 3) in forward, right, down axes of pixels inside the picture.

    Raises UserError for a pixel outside the picture, and where the lens distortion reaches no ray.
    """
    (x, y), shape = columns(px, py)
    inside = _inside(camera, x, y)
    if not inside.all():
        row = int(np.flatnonzero(~inside)[0])
        raise UserError(bad(f"inside the picture of {camera.width:g} × {camera.height:g} px", row, [x[row], y[row]]))
    out = kernel.direction_from_pixel(camera.parameters, x, y)
    lost = ~np.isfinite(out[0])
    if lost.any():
        row = int(np.flatnonzero(lost)[0])
        raise UserError(bad("where the lens distortion can be undone", row, [x[row], y[row]]))
    return np.stack(out, axis=-1).reshape(*shape, 3)


def pixel_from_direction_jacobian(camera: Camera, direction: ArrayLike) -> FloatArray:
    """Return d(px, py)/d(forward, right, down), (..., 2, 3), in pixels; raises as `pixel_from_direction`."""
    pixel_from_direction(camera, direction)
    cols, shape = _directions(direction)
    J: FloatArray = kernel.pixel_from_direction_jacobian(camera.parameters, *cols).reshape(*shape, 2, 3)
    return J


def direction_from_pixel_jacobian(camera: Camera, px: ArrayLike, py: ArrayLike) -> FloatArray:
    """Return d(forward, right, down)/d(px, py), (..., 3, 2), of unit directions; raises as `direction_from_pixel`."""
    direction_from_pixel(camera, px, py)
    cols, shape = columns(px, py)
    J: FloatArray = kernel.direction_from_pixel_jacobian(camera.parameters, *cols).reshape(*shape, 3, 2)
    return J


def _directions(direction: ArrayLike) -> tuple[list[FloatArray], tuple[int, ...]]:
    d, shape = rows(direction, 3, what="direction")
    return [np.ascontiguousarray(d[:, i]) for i in range(3)], shape


def _inside(camera: Camera, px: FloatArray, py: FloatArray) -> NDArray[np.bool_]:
    """The picture reaches half a pixel beyond the outermost centres; NaN is outside."""
    out: NDArray[np.bool_] = (px >= -0.5) & (px <= camera.width - 0.5) & (py >= -0.5) & (py <= camera.height - 0.5)
    return out
