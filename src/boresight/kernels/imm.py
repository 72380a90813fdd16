"""Interacting multiple models of unequal dimension: mixing, and whole streams in one call.

Models are packed to the largest dimension N: means (r, N), covariances (r, N, N), sizes (r,), and `labels` (r, N) that
name each component, so that components of one name are mixed with each other. A model that lacks a component takes
part with the mixing model's own belief of it (Yuan, Bar-Shalom, Willett 2012: unbiased mixing).
"""

# Numba caches by file and compiles kernels.gaussian into these: clear __pycache__ (make clean) when that changes.
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types

from boresight.kernels.observation import IntArray
from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

NEGLIGIBLE = 1e-15  # share of a model in the mixture of another
INTS = types.int64[::1]
INT_MATRIX = types.int64[:, ::1]
STACKS = types.float64[:, :, :, ::1]


@njit(cache=True)
def markov(rates: FloatArray, dt: float) -> FloatArray:
    """Return exp(rates·dt) (r, r): row i holds the probabilities of each model after dt, starting from model i."""
    r = rates.shape[0]
    largest = 0.0
    for i in range(r):
        largest = max(largest, -rates[i, i] * dt)
    halvings = 0
    while largest > 0.1:
        largest *= 0.5
        halvings += 1
    A = rates * (dt / 2.0**halvings)
    out, term = np.eye(r), np.eye(r)
    for k in range(1, 10):
        term = term @ A / k
        out += term
    for _ in range(halvings):
        out = out @ out
    return out


@njit(cache=True)
def mix(
    weights: FloatArray,
    transition: FloatArray,
    X: FloatArray,
    P: FloatArray,
    sizes: IntArray,
    labels: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the predicted weights (r,) and each model's mixed mean (r, N) and covariance (r, N, N)."""
    r, N = X.shape
    predicted = np.zeros(r)
    for j in range(r):
        for i in range(r):
            predicted[j] += transition[i, j] * weights[i]
    X_out, P_out = np.zeros_like(X), np.zeros_like(P)
    at = np.empty((r, N), np.int64)
    x = np.empty((r, N))
    share = np.empty(r)
    for j in range(r):
        n = sizes[j]
        for i in range(r):
            share[i] = transition[i, j] * weights[i] / predicted[j] if predicted[j] > 0.0 else (1.0 if i == j else 0.0)
            if share[i] < NEGLIGIBLE:
                continue
            for a in range(n):
                at[i, a] = place(labels, i, sizes[i], labels[j, a], a)
                x[i, a] = X[i, at[i, a]] if at[i, a] >= 0 else X[j, a]
                X_out[j, a] += share[i] * x[i, a]
        for i in range(r):
            if share[i] < NEGLIGIBLE:
                continue
            for a in range(n):
                for b in range(a + 1):
                    value = (x[i, a] - X_out[j, a]) * (x[i, b] - X_out[j, b])
                    if at[i, a] >= 0 and at[i, b] >= 0:
                        value += P[i, at[i, a], at[i, b]]
                    elif at[i, a] < 0 and at[i, b] < 0:
                        value += P[j, a, b]
                    P_out[j, a, b] += share[i] * value
        for a in range(n):
            for b in range(a):
                P_out[j, b, a] = P_out[j, a, b]
    return predicted, X_out, P_out


@njit(**PART)
def place(labels: IntArray, i: int, size: int, label: int, guess: int) -> int:
    """Return the index of a label in row i, most often `guess`; -1 where it is not."""
    if guess < size and labels[i, guess] == label:
        return guess
    for b in range(size):
        if labels[i, b] == label:
            return b
    return -1


@njit(cache=True)
def reweigh(predicted: FloatArray, log_likelihoods: FloatArray) -> FloatArray:
    """Return predicted·likelihood, normalised; no weight falls below 1e-12, so that none is lost for good."""
    best = log_likelihoods.max()
    out = np.empty_like(predicted)
    for j in range(predicted.shape[0]):
        out[j] = max(predicted[j] * math.exp(log_likelihoods[j] - best), 1e-12)
    total = out.sum()
    for j in range(out.shape[0]):
        out[j] /= total
    return out


@njit(cache=True)
def combine(weights: FloatArray, X: FloatArray, P: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Return the moment-matched mean (n,) and covariance (n, n) of the first n components."""
    x, out = np.zeros(n), np.zeros((n, n))
    r = X.shape[0]
    for j in range(r):
        x += weights[j] * X[j, :n]
    for j in range(r):
        for a in range(n):
            for b in range(n):
                out[a, b] += weights[j] * (P[j, a, b] + (X[j, a] - x[a]) * (X[j, b] - x[b]))
    return x, out


@njit(**PART)
def rescale(scale: FloatArray, z: FloatArray, m: int, rows: IntArray, R: FloatArray) -> None:
    """Multiply R[:m, :m] by √scale on both sides; the first m entries of `rows` are set to the components it holds."""
    i = 0
    for c in range(7):
        if not math.isnan(z[c]) and i < m:
            rows[i] = c
            i += 1
    for i in range(m):
        for j in range(m):
            R[i, j] *= math.sqrt(scale[rows[i]] * scale[rows[j]])


@njit(cache=True)
def adapt(
    scale: FloatArray,
    bias: FloatArray,
    seen: FloatArray,
    rows: IntArray,
    e: FloatArray,
    spread: FloatArray,
    nominal: FloatArray,
    memory: float,
    limit: float,
) -> None:
    """Move one sensor's noise scale (7,), of the components `rows` (m,), towards what a residual shows.

    After an update the residual e = z - h(x⁺) and HP⁺Hᵀ (`spread`) tell R: E[e²] + HP⁺Hᵀ = R (the EM step; Särkkä and
    Nummenmaa 2009 in its stationary form). A manoeuvre shows as a residual that keeps its sign: its running mean
    `bias` over a fifth of the memory is taken off first, so that it is not mistaken for noise. A single residual counts
    for no more than 9 times the present R, and the scale stays within `limit` and 1/`limit` of the declared one.
    `memory` is in reports; `seen` (7,) counts them, so that the first ones weigh more.
    """
    for i in range(rows.shape[0]):
        c = rows[i]
        seen[c] += 1.0
        a = max(5.0 / memory, 1.0 / seen[c])
        d = e[i] - bias[c] if seen[c] > 1.0 else e[i]
        gain = 1.0 + a / (2.0 - a) if seen[c] > 1.0 else 1.0
        bias[c] += a * (e[i] - bias[c])
        present = scale[c] * nominal[i]
        shown = min(d * d / gain, 9.0 * present) + spread[i]
        g = max(1.0 / memory, 1.0 / (seen[c] + 10.0))
        scale[c] = min(max((1.0 - g) * scale[c] + g * shown / nominal[i], 1.0 / limit), limit)


@njit(**PART)
def learn(
    observe: Any,
    x: FloatArray,
    P: FloatArray,
    z: FloatArray,
    context: FloatArray,
    scale: FloatArray,
    bias: FloatArray,
    seen: FloatArray,
    memory: float,
    limit: float,
) -> None:
    """Show `adapt` one report's residual at the updated mean `x` (n,), covariance `P`: one sensor's rows (7,)."""
    n = x.shape[0]
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    rows = np.empty(7, np.int64)
    m = observe(x, z, context, y, H, R)
    rescale(np.ones(7), z, m, rows, R)
    nominal, spread = np.empty(m), np.zeros(m)
    for i in range(m):
        nominal[i] = R[i, i]
        for a in range(n):
            for b in range(n):
                spread[i] += H[i, a] * P[a, b] * H[i, b]
    adapt(scale, bias, seen, rows[:m], y, spread, nominal, memory, limit)
