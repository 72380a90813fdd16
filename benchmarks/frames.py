"""Every transform against pymap3d and SciPy's Rotation, in the same run: `python benchmarks/frames.py`.

Prints, per transform, the time of one scalar call and of 1e5 points in one call, for us and for the peer, and the
ratios (peer / ours: above 1 we are faster).
"""

from __future__ import annotations

import timeit
from collections.abc import Callable
from functools import partial

import numpy as np
import pymap3d
from scipy.spatial.transform import Rotation, Slerp

from boresight.frames import attitude, azel, geodetic, local
from boresight.types import Site

POINTS = 100_000
LAT0, LON0, H0 = 0.7, 0.2, 100.0
SITE = Site(LAT0, LON0, H0)
Call = Callable[[], object]
ORIGIN = (LAT0, LON0, H0)
RNG = np.random.default_rng(0)


def seconds(call: Callable[[], object]) -> float:
    """Return the best time of one call out of several rounds of about 20 ms."""
    call()
    number = max(1, int(0.02 / max(min(timeit.repeat(call, number=1, repeat=3)), 1e-7)))
    return min(timeit.repeat(call, number=number, repeat=9)) / number


def cases() -> list[tuple[str, Callable[..., object], Callable[..., object], tuple[np.ndarray, ...]]]:
    """Return (name, ours, the peer's, arguments as arrays) of every transform."""
    lat, lon = RNG.uniform(-1.57, 1.57, POINTS), RNG.uniform(-3.14, 3.14, POINTS)
    h = RNG.uniform(0, 2e4, POINTS)
    near = (LAT0 + RNG.uniform(-0.1, 0.1, POINTS), LON0 + RNG.uniform(-0.1, 0.1, POINTS), h)
    ecef, enu = geodetic.ecef_from_geodetic(*near), local.enu_from_geodetic(*near, SITE)
    aer = azel.azel_from_enu(*enu)
    return [
        ("ecef_from_geodetic", geodetic.ecef_from_geodetic, peer("geodetic2ecef"), (lat, lon, h)),
        ("geodetic_from_ecef", geodetic.geodetic_from_ecef, peer("ecef2geodetic"), ecef),
        ("enu_from_ecef", at_site(local.enu_from_ecef), peer("ecef2enu", *ORIGIN), ecef),
        ("ecef_from_enu", at_site(local.ecef_from_enu), peer("enu2ecef", *ORIGIN), enu),
        ("enu_from_geodetic", at_site(local.enu_from_geodetic), peer("geodetic2enu", *ORIGIN), near),
        ("geodetic_from_enu", at_site(local.geodetic_from_enu), peer("enu2geodetic", *ORIGIN), enu),
        ("ned_from_geodetic", at_site(local.ned_from_geodetic), peer("geodetic2ned", *ORIGIN), near),
        ("azel_from_enu", azel.azel_from_enu, peer("enu2aer"), enu),
        ("enu_from_azel", azel.enu_from_azel, peer("aer2enu"), aer),
        ("azel_from_geodetic", at_site(azel.azel_from_geodetic), peer("geodetic2aer", *ORIGIN), near),
        ("geodetic_from_azel", at_site(azel.geodetic_from_azel), peer("aer2geodetic", *ORIGIN), aer),
    ]


def peer(name: str, *extra: float) -> Callable[..., object]:
    """Return pymap3d's function of a name, in radians."""
    function = getattr(pymap3d, name)
    return lambda *a: function(*a, *extra, deg=False)


def at_site(function: Callable[..., object]) -> Callable[..., object]:
    """Return one of ours with the site given."""
    return lambda *a: function(*a, SITE)


def rotation_cases() -> list[tuple[str, Call, Call, Call, Call]]:
    """Return (name, ours scalar, SciPy's scalar, ours on many, SciPy's on many)."""
    from_euler, from_quat, from_matrix = Rotation.from_euler, Rotation.from_quat, Rotation.from_matrix
    ypr = np.stack([RNG.uniform(-3, 3, POINTS), RNG.uniform(-1.5, 1.5, POINTS), RNG.uniform(-3, 3, POINTS)], axis=-1)
    one = tuple(float(v) for v in ypr[0])
    columns = tuple(np.ascontiguousarray(ypr[:, i]) for i in range(3))
    R = attitude.ned_from_body(*columns)
    q = attitude.quaternion_from_ypr(*columns)
    xyzw = np.roll(q, -1, axis=-1)
    s = np.linspace(0, 1, POINTS)
    pair = from_quat(xyzw[:2])
    return [
        ("ned_from_body", lambda: attitude.ned_from_body(*one),
         lambda: from_euler("ZYX", one).as_matrix(),
         lambda: attitude.ned_from_body(*columns),
         lambda: from_euler("ZYX", ypr).as_matrix()),
        ("ypr_from_rotation", lambda: attitude.ypr_from_rotation(R[0]),
         lambda: from_matrix(R[0]).as_euler("ZYX"),
         lambda: attitude.ypr_from_rotation(R),
         lambda: from_matrix(R).as_euler("ZYX")),
        ("quaternion_from_ypr", lambda: attitude.quaternion_from_ypr(*one),
         lambda: from_euler("ZYX", one).as_quat(),
         lambda: attitude.quaternion_from_ypr(*columns),
         lambda: from_euler("ZYX", ypr).as_quat()),
        ("rotation_from_quaternion", lambda: attitude.rotation_from_quaternion(q[0]),
         lambda: from_quat(xyzw[0]).as_matrix(),
         lambda: attitude.rotation_from_quaternion(q),
         lambda: from_quat(xyzw).as_matrix()),
        ("quaternion_from_rotation", lambda: attitude.quaternion_from_rotation(R[0]),
         lambda: from_matrix(R[0]).as_quat(),
         lambda: attitude.quaternion_from_rotation(R),
         lambda: from_matrix(R).as_quat()),
        ("multiply", lambda: attitude.multiply(q[0], q[1]),
         lambda: from_quat(xyzw[0]) * from_quat(xyzw[1]),
         lambda: attitude.multiply(q, q),
         lambda: from_quat(xyzw) * from_quat(xyzw)),
        ("slerp", lambda: attitude.slerp(q[0], q[1], 0.3), lambda: Slerp([0, 1], pair)(0.3),
         lambda: attitude.slerp(q[0], q[1], s), lambda: Slerp([0, 1], pair)(s)),
    ]  # fmt: skip


def main() -> None:
    """Print the table."""
    print(f"{'transform':26s} {'scalar µs':>10s} {'peer µs':>9s} {'ratio':>6s}   ", end="")
    print(f"{'1e5 ms':>8s} {'peer ms':>8s} {'ratio':>6s}")
    rows: list[tuple[str, float, float, float, float]] = []
    for name, ours, theirs, arrays in cases():
        one = tuple(float(a[7]) for a in arrays)
        few = seconds(partial(ours, *one)), seconds(partial(theirs, *one))
        rows.append((name, *few, seconds(partial(ours, *arrays)), seconds(partial(theirs, *arrays))))
    for name, a, b, c, d in rotation_cases():
        rows.append((name, seconds(a), seconds(b), seconds(c), seconds(d)))
    for name, us, peer, many, peer_many in rows:
        print(
            f"{name:26s} {us * 1e6:10.2f} {peer * 1e6:9.2f} {peer / us:6.1f}   "
            f"{many * 1e3:8.2f} {peer_many * 1e3:8.2f} {peer_many / many:6.1f}"
        )


if __name__ == "__main__":
    main()
