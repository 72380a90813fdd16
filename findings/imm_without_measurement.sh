#!/usr/bin/env bash
# Expected: an IMM without a measurement keeps the mode probabilities that its transition matrix predicts ("If z is None, nothing
# is changed", says update); and the larger an innovation, the surer the model with more process noise.
# What happens: FilterPy counts a missing measurement as one with residual 0 and the last S, so that silence makes the quiet model
# sure; and beyond an innovation of some 38 sigma of each model the likelihoods hit one floor, and nothing is learnt.
# Version: filterpy 2.0.0. Why it matters: a target lost behind an obstacle is predicted with the covariance of straight flight
# when its manoeuvre is most likely, and is not found again; after the largest jump the filter stays with the wrong model.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q filterpy==2.0.0 numpy==2.3.5
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter

print("filterpy", version("filterpy"))
turn = np.array([[0.95, 0.05], [0.05, 0.95]])

def imm(measurements):
    models = []
    for q in (0.01, 100.0):
        f = KalmanFilter(2, 1)
        f.F, f.H, f.P, f.R, f.Q = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]]), np.eye(2) * 10, np.eye(1), np.eye(2) * q
        models.append(f)
    both = IMMEstimator(models, np.array([0.9, 0.1]), turn)
    for z in measurements:
        both.predict()
        both.update(z)
    return both.mu

start, silent = imm([0.0] * 3), imm([0.0] * 3 + [None] * 20)
print("after 3 measurements:", start, "then 20 steps without:", silent, "predicted:", start @ np.linalg.matrix_power(turn, 20))
jumps = [imm([z])[1] for z in (30.0, 100.0, 1000.0)]
print("probability of the noisy model after an innovation of 30, 100, 1000:", jumps)
sys.exit(0 if silent[0] > 0.98 and jumps[0] > 0.99 and jumps[1] > 0.99 and jumps[2] < 0.2 else 1)
PY
