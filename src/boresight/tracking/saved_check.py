"""Whether the arrays of a saved state are whole: nothing else may reach the compiled tracker."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.kernels.tracker import GATED
from boresight.kernels.tracker_copies import WHOLE, Copies, each_of
from boresight.kernels.tracker_looks import PER_DETECTION, PER_LOOK, PER_POSE, no_looks
from boresight.kernels.tracker_rows import ARRIVAL, EMITTED, GAPS_KEPT
from boresight.kernels.tracker_window import NO_POSE

Arrays = Mapping[str, NDArray[np.generic]]
ADVICE = "damaged, or made with other sensors or settings; use the same recording and --config"
FINITE = ("x", "P", "weight", "anchor", "anchor_P", "mode", "mode_x", "mode_P", "clutter", "undetected", "seen_range")
SPREAD = 1e-6  # of a correlation matrix: least eigenvalue and asymmetry that rounding explains
LONGEST_SILENCE = 60.0  # s from the newest row to the newest arrival, at most: rows are never missing for so long
NAN_MEANS_NOT_MEASURED = ("looks.z", "looks.R", "fates.nis")


def check_arrays(arrays: Arrays, empty: Copies, length: float, keep_after: float | None) -> None:
    """Raise UserError unless the arrays are those of a tracker whose `plan.empty`, window (s) and sensors these are.

    `keep_after`: as `tracking.window.take` takes it; None where it is the time in the arrays.
    """
    _shapes(arrays, empty)
    a: dict[str, Any] = dict(arrays)
    _offsets(a)
    _numbers(a)
    _times(a, length, float(a["smoothed"][0]) if keep_after is None else keep_after)
    for prefix in ("tracks", "copies"):
        _covariances(f"{prefix}.P", a[f"{prefix}.P"])
        _covariances(f"{prefix}.anchor_P", a[f"{prefix}.anchor_P"], zero=True)
        if f"{prefix}.mode" in a:
            used = a[f"{prefix}.mode"] > 0.0
            _require(bool(used.any(axis=1).all()), f"{prefix}.mode", "leaves a track without a model")
            _covariances(f"{prefix}.mode_P", a[f"{prefix}.mode_P"][used])


def _require(sound: bool, name: str, words: str) -> None:
    if not sound:
        raise UserError(f"saved tracker state: {name} {words}: {ADVICE}")


def _shapes(arrays: Arrays, empty: Copies) -> None:
    """Compare names, types and shapes with those that the tracker has."""
    sensors = empty.last_look.shape[1]
    whole, each = (*WHOLE,), each_of(empty)
    looks = no_looks()._asdict()
    names = {"format", "counts", "smoothed", "names.birth", "names.number", "names.last", "copies.used", "copies.t"}
    names |= {"copies.number", "copies.first"} | {f"{p}.{n}" for p in ("tracks", "copies") for n in (*whole, *each)}
    names |= {f"looks.{n}" for n in looks} | {f"fates.{n}" for n in ("outcome", "code", "owner", "nis")}
    names |= {f"clock.{n}" for n in ("now", "last", "gaps", "known")}
    for name in sorted(names ^ set(arrays)):
        _require(False, name, "is missing" if name in names else "does not belong to it")
    for name in ("tracks.live", "copies.used", "looks.t", "names.birth"):  # these say how long the others are
        _require(arrays[name].ndim == 1 and arrays[name].dtype.kind in "if", name, "is not a column of numbers")
        _require(len(arrays[name]) > 0 or name in ("looks.t", "names.birth"), name, "is empty")
    n, c = int(arrays["tracks.live"][0]), int(arrays["copies.used"][0])
    k, named = len(arrays["looks.t"]), len(arrays["names.birth"])
    many, copied = (len(arrays[name]) if arrays[name].ndim else 0 for name in ("looks.dt", "copies.birth"))
    whole_number, number = np.dtype(np.int64), np.dtype(np.float64)
    expected: dict[str, tuple[tuple[int, ...], np.dtype[Any]]] = {
        "format": ((1,), whole_number),
        "counts": ((2,), whole_number),
        "smoothed": ((1,), number),
        "names.birth": ((named,), whole_number),
        "names.number": ((named,), whole_number),
        "names.last": ((named,), number),
        "copies.used": ((1,), whole_number),
        "copies.t": ((c,), number),
        "copies.number": ((c,), whole_number),
        "copies.first": ((c + 1,), whole_number),
        "fates.outcome": ((k,), whole_number),
        "fates.code": ((many,), whole_number),
        "fates.owner": ((many,), whole_number),
        "fates.nis": ((many,), number),
        "clock.now": ((3,), number),
        "clock.last": ((sensors,), number),
        "clock.gaps": ((sensors, GAPS_KEPT), number),
        "clock.known": ((sensors,), whole_number),
    }
    for name in whole:
        like = getattr(empty, name)
        expected[f"tracks.{name}"] = like.shape[1:], like.dtype
        expected[f"copies.{name}"] = (c, *like.shape[1:]), like.dtype
    for name in each:
        like = getattr(empty, name)
        expected[f"tracks.{name}"] = (n, *like.shape[1:]), like.dtype
        expected[f"copies.{name}"] = (copied, *like.shape[1:]), like.dtype
    size = dict.fromkeys(PER_LOOK, k) | dict.fromkeys(PER_DETECTION, many) | dict.fromkeys(PER_POSE, k + many)
    for name, like in looks.items():
        expected[f"looks.{name}"] = ((size | {"first": k + 1})[name], *like.shape[1:]), like.dtype
    for name, (shape, dtype) in expected.items():
        found = arrays[name]
        _require(found.dtype == dtype, name, f"holds {found.dtype}, not {dtype}")
        _require(found.shape == shape, name, f"has shape {found.shape}, not {shape}")


def _offsets(a: dict[str, Any]) -> None:
    """Check what is used as an index or a count."""
    sensors, k = len(a["clock.last"]), len(a["looks.t"])
    for name, total in (("copies.first", len(a["copies.birth"])), ("looks.first", len(a["looks.dt"]))):
        first = a[name]
        sound = first[0] == 0 and first[-1] == total and bool((np.diff(first) >= 0).all())
        _require(sound, name, f"does not go up from 0 to {total}")
    _require(bool((np.diff(a["copies.first"]) == a["copies.live"][:, 0]).all()), "copies.live", "is not what is held")
    arrivals = int(a["counts"][0])
    limits = {
        "counts": (0, 2**53),
        "tracks.live": (0, 2**53),
        "copies.live": (0, 2**53),
        "tracks.birth": (0, 2**53),
        "copies.birth": (0, 2**53),
        "copies.number": (0, arrivals - 1),
        "looks.number": (0, arrivals - 1),
        "looks.sensor": (0, sensors - 1),
        "looks.row": (-1, 2**53),
        "looks.address": (-1, 2**53),
        "fates.outcome": (0, NO_POSE),
        "fates.code": (0, GATED),
        "fates.owner": (-1, 2**53),
        "clock.known": (0, GAPS_KEPT),
        "names.birth": (0, 2**53),
        "names.number": (1, int(a["counts"][1])),
    }
    for name, (low, high) in limits.items():
        _require(bool(((a[name] >= low) & (a[name] <= high)).all()), name, f"is not within {low} to {high}")
    _require(len(np.unique(a["looks.number"])) == k, "looks.number", "names a look twice")
    _require(bool((np.diff(a["names.birth"]) > 0).all()), "names.birth", "does not ascend")


def _numbers(a: dict[str, Any]) -> None:
    """Check that there is no NaN but where it says something, and nothing infinite in what is calculated with."""
    for name, array in a.items():
        if array.dtype.kind != "f":
            continue
        if name not in NAN_MEANS_NOT_MEASURED:
            _require(not np.isnan(array).any(), name, "holds a NaN")
        if name.partition(".")[2] in FINITE or name.partition(".")[0] == "looks" or name in ("clock.gaps", "copies.t"):
            _require(not np.isinf(array).any(), name, "holds an infinite number")
    for name in ("weight", "mode"):
        for prefix in ("tracks", "copies"):
            share = a.get(f"{prefix}.{name}")
            if share is not None:
                _require(
                    bool(((share >= 0.0) & (share <= 1.0 + SPREAD)).all()), f"{prefix}.{name}", "is no probability"
                )
    measured = np.isfinite(a["looks.z"])
    variance = np.einsum("mii->mi", a["looks.R"])
    _require(bool((variance[measured] > 0.0).all()), "looks.R", "holds a variance that is not above zero")
    both = measured[:, :, None] & measured[:, None, :]
    _covariances("looks.R", np.where(both, a["looks.R"], np.eye(7)))


def _times(a: dict[str, Any], length: float, keep_after: float) -> None:
    """Check that times agree with each other: the tracker steps from one to the next, and back to a copy."""
    t, copied, number = a["looks.t"], a["copies.t"], a["looks.number"]
    for name in ("looks.t", "copies.t"):
        _require(bool((np.diff(a[name]) >= 0.0).all()), name, "does not go up")
    now = a["clock.now"]
    arrival, emitted = float(now[ARRIVAL]), float(now[EMITTED])
    sound = arrival < np.inf and (emitted == -np.inf or arrival - LONGEST_SILENCE <= emitted < np.inf)
    _require(sound, "clock.now", "holds times that do not go together")
    _require(bool((a["clock.last"] <= arrival).all()), "clock.last", "is after the newest arrival")
    _require(bool((a["clock.gaps"] >= 0.0).all()), "clock.gaps", "holds a negative time")
    if not len(t):
        _require(
            not len(copied) and not len(a["tracks.birth"]), "copies.used", "holds tracks although no look was taken"
        )
        return
    _require(abs(a["tracks.time"][0] - t[-1]) <= 1.0, "tracks.time", "is not that of the newest look")
    _require(bool((a["copies.time"][:, 0] <= copied).all()), "copies.time", "is after that of the look")
    if not len(copied):
        return
    oldest = min(t[-1] - length, keep_after)
    c = max(int(np.searchsorted(copied, oldest, side="right")) - 1, 0)
    order = np.argsort(number)
    at = order[np.minimum(np.searchsorted(number[order], a["copies.number"][c:]), len(order) - 1)]
    sound = bool((number[at] == a["copies.number"][c:]).all() and (t[at] == copied[c:]).all())
    _require(sound, "copies.number", "names looks that are not there")


def _covariances(name: str, P: Any, zero: bool = False) -> None:
    """Check covariances (..., n, n): symmetric, positive; with `zero`, a variance may be zero."""
    n = P.shape[-1]
    P = P.reshape(-1, n, n)
    if not P.size:
        return
    variance = np.einsum("mii->mi", P)
    _require(bool((variance >= 0.0 if zero else variance > 0.0).all()), name, "holds a variance that is not above zero")
    with np.errstate(over="ignore", invalid="ignore"):
        sigma = np.sqrt(np.where(variance > 0.0, variance, 1.0))
        R = P / sigma[:, :, None] / sigma[:, None, :]
        sound = bool(np.isfinite(R).all() and (np.abs(R - R.transpose(0, 2, 1)) <= SPREAD).all())
    _require(sound, name, "holds a covariance that is not symmetric")
    _require(bool((np.linalg.eigvalsh(R)[:, 0] >= -SPREAD).all()), name, "holds a covariance that is not positive")
