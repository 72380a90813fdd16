"""Odd surroundings: no cache folder, read-only package, no compiler, one core, forked and spawned workers."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import boresight

SOURCE = Path(boresight.__file__).parent
UPDATE = """
import numpy as np
import boresight
state = boresight.GaussianState(0.0, np.array([4000.0, 3000, 1000, -100, 20, 0]), np.diag([1e4] * 3 + [400] * 3))
motion, radar = boresight.NearlyConstantVelocity(q=0.5), boresight.Radar(5.0, 0.01, 0.01)
state, info = boresight.update(boresight.predict(state, motion, 0.1), radar, np.array([5000.0, 0.9, 0.2]))
print(float(state.x[0]), float(info.nis))
"""


def updated(_: int = 0) -> tuple[float, float]:
    """One prediction and one update, in whichever process."""
    P = np.diag([1e4, 1e4, 1e4, 400, 400, 400])
    state = boresight.GaussianState(0.0, np.array([4000.0, 3000, 1000, -100, 20, 0]), P)
    motion, radar = boresight.NearlyConstantVelocity(q=0.5), boresight.Radar(5.0, 0.01, 0.01)
    state, info = boresight.update(boresight.predict(state, motion, 0.1), radar, np.array([5000.0, 0.9, 0.2]))
    return float(state.x[0]), info.nis


def told(environment: dict[str, str], prefix: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environment}
    return subprocess.run([*prefix, sys.executable, "-c", UPDATE], capture_output=True, text=True, env=env, check=False)


def assert_same(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose([float(w) for w in done.stdout.split()], updated(), rtol=1e-12)


@pytest.mark.slow
def test_a_package_that_cannot_be_written_and_no_cache_folder(tmp_path: Path) -> None:
    """Files where the cache folders would be: nobody can write there, root neither."""
    package = tmp_path / "site" / "boresight"
    shutil.copytree(SOURCE, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [package, *(p for p in package.rglob("*") if p.is_dir())]:
        (folder / "__pycache__").touch()
    (tmp_path / "home").touch()
    nowhere = {
        "PYTHONPATH": str(package.parent),
        "HOME": str(tmp_path / "home"),
        "XDG_CACHE_HOME": str(tmp_path / "home"),
    }
    done = told(nowhere)
    assert_same(done)
    assert done.stderr.count("\n") == 1
    assert "set NUMBA_CACHE_DIR" in done.stderr

    # read-only package, a cache folder of the user's: quiet, and cached
    cache = tmp_path / "cache"
    for _ in range(2):
        done = told({**nowhere, "NUMBA_CACHE_DIR": str(cache)})
        assert_same(done)
        assert done.stderr == ""
    assert list(cache.rglob("*.nbc"))


def test_without_the_compiler() -> None:
    assert_same(told({"NUMBA_DISABLE_JIT": "1"}))


def test_packed_kernels_without_the_compiler() -> None:
    code = """
import numpy as np
from boresight.association import nearest
from boresight.filters import ekf, packed
from boresight.models import Infrared, NearlyConstantVelocity, Radar
prior = ekf.init(0.0, np.array([4000.0, 3000, 1000, -100, 20, 0]), np.diag([1e4, 1e4, 1e4, 400, 400, 400]))
sensors, motion = [Radar(5.0, 0.01, 0.01), Infrared(0.01, 0.01)], NearlyConstantVelocity(q=0.5)
z = [np.array([5000.0, 0.9, 0.2]), np.array([0.91, 0.21])]
belief = packed.pack(prior, motion)
packed.run(belief, packed.table([0.1, 0.2], sensors, z))
many = packed.run_many(motion, 0.0, prior.x[None], prior.P, np.array([0.1, 0.2]), sensors, [r[None] for r in z])
assert np.allclose(many.x[0], packed.unpack(belief).x)
found = nearest.assign(np.zeros((2, 2)), np.array([np.eye(2)] * 2), np.ones((1, 2)), gate=9.0, clutter_density=1e-6)
print(repr(float(belief[2])), found.detection.tolist())
"""
    said = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            capture_output=True,
            text=True,
            env={**os.environ, **e},
            check=False,
        )
        for e in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    assert [s.returncode for s in said] == [0, 0], said[1].stderr
    assert float(said[0].stdout.split()[0]) == pytest.approx(float(said[1].stdout.split()[0]), rel=1e-12)
    assert said[0].stdout.split()[1:] == said[1].stdout.split()[1:]


def test_own_kernels_without_the_compiler_say_so_in_one_line() -> None:
    code = """
from boresight.errors import UserError
from boresight.filters import own
from boresight.models import NearlyConstantVelocity, Radar
try:
    own.models(NearlyConstantVelocity(1.0), Radar(1.0))
except UserError as error:
    print(error)
"""
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, check=True)
    assert "take filters.ekf or stream" in done.stdout


@pytest.mark.skipif(shutil.which("taskset") is None, reason="taskset is not there to give one core only")
def test_on_one_core() -> None:
    assert_same(told({}, prefix=("taskset", "-c", "0")))


@pytest.mark.parametrize(
    "method", ["spawn", pytest.param("fork", marks=pytest.mark.skipif(os.name != "posix", reason="no fork"))]
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_workers(method: str) -> None:
    expected = updated()  # a forked worker finds the kernels loaded
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map(updated, range(4)) == [expected] * 4


def test_caches_of_other_kernels_are_dropped(tmp_path: Path) -> None:
    """Numba would keep a caller compiled against a callee that has changed since."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", "import boresight.kernels"]
    subprocess.run(command, env=environment, check=True)
    (stamp,) = tmp_path.rglob("kernels.stamp")
    index = stamp.parent / "some.kernel.nbi"
    index.write_text("")
    subprocess.run(command, env=environment, check=True)
    assert index.exists()  # nothing has changed
    stamp.write_text("of another version")
    subprocess.run(command, env=environment, check=True)
    assert not index.exists()
    assert stamp.read_text() != "of another version"
