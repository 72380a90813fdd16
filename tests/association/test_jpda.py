"""Marginals of joint events against enumeration, PyEHM and closed forms; messages against trees; existence."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numba import njit
from scipy.stats import chi2, multivariate_normal

from boresight.association import jpda
from boresight.errors import UserError
from boresight.kernels.jpda import ALONE, EXACT, LOOPY
from boresight.kernels.jpda import marginals as kernel


def enumerate_all(weight: np.ndarray, miss: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every joint event, one by one: pairs (n, m) and misses (n,)."""
    n, m = weight.shape
    p, alone, total = np.zeros((n, m)), np.zeros(n), 0.0
    for event in itertools.product(range(-1, m), repeat=n):
        taken = [j for j in event if j >= 0]
        if len(set(taken)) < len(taken):
            continue
        q = np.prod([miss[i] if j < 0 else weight[i, j] for i, j in enumerate(event)])
        total += q
        for i, j in enumerate(event):
            if j < 0:
                alone[i] += q
            else:
                p[i, j] += q
    return p / total, alone / total


def problem(rng: np.random.Generator, n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights over e⁶, some outside the gate; misses of every size."""
    inside = rng.random((n, m)) < rng.uniform(0.2, 1.0)
    return np.exp(rng.normal(0.0, 3.0, (n, m))) * inside, 10.0 ** rng.uniform(-9.0, 0.0, n)


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 4), (4, 1), (3, 3), (5, 3), (3, 5), (4, 4), (5, 4)])
def test_marginals_equal_enumeration(n: int, m: int) -> None:
    rng = np.random.default_rng(10 * n + m)
    for _ in range(20):
        weight, miss = problem(rng, n, m)
        found = jpda.marginals(weight, miss)
        p, alone = enumerate_all(weight, miss)
        np.testing.assert_allclose(found.p, p, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found.p_miss, alone, atol=1e-12)
        assert found.exact.all()


def test_a_track_that_cannot_be_missed() -> None:
    weight = np.array([[2.0, 1.0, 0.0], [1.0, 3.0, 1.0]])
    p, alone = enumerate_all(weight, np.array([0.0, 0.5]))
    found = jpda.marginals(weight, [0.0, 0.5])
    np.testing.assert_allclose(found.p, p, atol=1e-14)
    np.testing.assert_allclose(found.p_miss, alone, atol=1e-14)
    for most in (1e6, 0.0):  # two that cannot be missed, one report: no event at all, and no crash
        none = jpda.marginals([[1.0], [1.0]], [0.0, 0.0], most_states=most)
        assert np.isfinite(none.p).all()


@pytest.mark.parametrize(("n", "m"), [(7, 7), (6, 12), (12, 6), (10, 10)])
def test_marginals_equal_pyehm(n: int, m: int) -> None:
    EHM2 = pytest.importorskip("pyehm.core", reason="PyEHM is not installed (bench extra)").EHM2
    rng = np.random.default_rng(n * m)
    for _ in range(10):
        weight, miss = problem(rng, n, m)
        both = np.c_[miss, weight]
        expected = EHM2().run((both > 0).astype(np.int32), both)
        found = jpda.marginals(weight, miss)
        np.testing.assert_allclose(found.p, expected[:, 1:], atol=1e-9)
        np.testing.assert_allclose(found.p_miss, expected[:, 0], atol=1e-9)


def dense_fourteen() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(14)
    return np.exp(rng.normal(0.0, 1.0, (14, 14))), np.full(14, 0.2)


def test_a_dense_cluster_is_exact_whatever_its_order_and_scale() -> None:
    """14 tracks, 14 reports: turned to columns, permuted, scaled, the marginals are the same; and they add up."""
    rng = np.random.default_rng(3)
    weight, miss = dense_fourteen()
    found = jpda.marginals(weight, miss)
    assert found.exact.all()
    np.testing.assert_allclose(found.p.sum(axis=1) + found.p_miss, 1.0, atol=1e-12)
    assert (found.p.sum(axis=0) <= 1.0 + 1e-12).all()
    rows, columns, scale = rng.permutation(14), rng.permutation(14), 10.0 ** rng.uniform(-30, 30, 14)
    other = jpda.marginals((scale[:, None] * weight)[np.ix_(rows, columns)], (scale * miss)[rows])
    np.testing.assert_allclose(other.p, found.p[np.ix_(rows, columns)], atol=1e-12)
    counted = jpda.marginals((weight / miss[:, None]).T, np.ones(14))  # reports take tracks: the same events
    np.testing.assert_allclose(counted.p.T, found.p, atol=1e-12)


def ladder(n: int, rng: np.random.Generator) -> np.ndarray:
    """Track i reaches reports i - 1 to i + 1: one long cluster with cycles."""
    weight = np.exp(rng.normal(0.0, 1.0, (n, n)))
    i = np.arange(n)
    weight[np.abs(i[:, None] - i) > 1] = 0.0
    return weight


def test_a_long_chain_is_exact_and_ends_with_the_same_as_its_parts() -> None:
    """200 tracks in one row; cut where the tracks cannot share a report, the parts are independent."""
    rng = np.random.default_rng(5)
    weight, miss = ladder(200, rng), rng.uniform(0.1, 1.0, 200)
    whole = jpda.marginals(weight, miss)
    assert whole.exact.all()
    first = enumerate_all(weight[:4, :5], miss[:4])[0]
    cut = weight.copy()
    cut[4:, :5] = 0.0
    parts = jpda.marginals(cut, miss)
    np.testing.assert_allclose(parts.p[:4, :5], first, atol=1e-12)
    rest = jpda.marginals(cut[4:, 5:], miss[4:])
    np.testing.assert_allclose(parts.p[4:, 5:], rest.p, atol=1e-12)
    permuted = rng.permutation(200)
    np.testing.assert_allclose(jpda.marginals(weight[permuted], miss[permuted]).p, whole.p[permuted], atol=1e-11)


def test_clusters_of_every_shape_do_not_depend_on_the_order() -> None:
    """Tracks and clutter in a square: reports open and close in any order, from either side."""
    rng = np.random.default_rng(11)
    for _ in range(60):
        n, m = rng.integers(5, 25, 2)
        x, z = rng.uniform(0.0, 10.0, (n, 2)), rng.uniform(0.0, 10.0, (m, 2))
        d2 = ((z[None] - x[:, None]) ** 2).sum(axis=2)
        weight, miss = np.where(d2 < 6.0, np.exp(-0.5 * d2), 0.0), rng.uniform(0.05, 1.0, n)
        found = jpda.marginals(weight, miss, most_states=3e6)
        rows, columns = rng.permutation(n), rng.permutation(m)
        other = jpda.marginals(weight[np.ix_(rows, columns)], miss[rows], most_states=3e6)
        np.testing.assert_allclose(other.p, found.p[np.ix_(rows, columns)], atol=1e-11 if found.exact.all() else 1e-6)
        turned = jpda.marginals((weight / miss[:, None]).T, np.ones(m), most_states=3e6)
        assert (turned.exact.all()) == (found.exact.all())
        np.testing.assert_allclose(turned.p.T, found.p, atol=1e-11 if found.exact.all() else 1e-6)


def test_many_reports_of_one_track_alone_cost_nothing() -> None:
    """A hundred reports in one gate, three of them shared: as if the others were one."""
    rng = np.random.default_rng(12)
    weight, miss = np.zeros((2, 100)), np.array([0.2, 0.3])
    weight[0], weight[1, :3] = rng.uniform(0.1, 1.0, 100), rng.uniform(0.1, 1.0, 3)
    found = jpda.marginals(weight, miss, most_states=100.0)
    assert found.exact.all()
    few = np.zeros((2, 4))
    few[:, :3], few[0, 3] = weight[:, :3], weight[0, 3:].sum()
    p, alone = enumerate_all(few, miss)
    np.testing.assert_allclose(found.p[:, :3], p[:, :3], atol=1e-12)
    np.testing.assert_allclose(found.p[0, 3:], p[0, 3] * weight[0, 3:] / few[0, 3], atol=1e-12)
    np.testing.assert_allclose(found.p_miss, alone, atol=1e-12)


def test_messages_are_exact_where_there_is_no_cycle() -> None:
    rng = np.random.default_rng(6)
    n = 30
    weight = np.zeros((n, n + 1))
    i = np.arange(n)
    weight[i, i], weight[i, i + 1] = np.exp(rng.normal(0.0, 2.0, (2, n)))
    miss = rng.uniform(0.05, 1.0, n)
    exact, loopy = jpda.marginals(weight, miss), jpda.marginals(weight, miss, most_states=0.0)
    assert exact.exact.all()
    assert not loopy.exact.any()
    np.testing.assert_allclose(loopy.p, exact.p, atol=1e-8)


def test_messages_are_near_in_a_dense_cluster() -> None:
    """What docs/association.md says of them: some hundredths."""
    weight, miss = dense_fourteen()
    exact, loopy = jpda.marginals(weight, miss), jpda.marginals(weight, miss, most_states=0.0)
    off = np.abs(exact.p - loopy.p)
    assert off.max() < 0.05
    assert off.max() > 1e-4  # it is an approximation: this test sees it
    np.testing.assert_allclose(loopy.p.sum(axis=1) + loopy.p_miss, 1.0, atol=1e-9)


def test_one_track_is_pda() -> None:
    """β_j = e_j / (b + Σ e), Bar-Shalom and Li 1995, 3.4: a closed form with p_G in b."""
    rng = np.random.default_rng(7)
    S, z = np.array([[4.0, 1.0], [1.0, 2.0]]), rng.normal(0.0, 1.5, (5, 2))
    x, gate, p_d, density = np.zeros((1, 2)), 9.0, 0.8, 0.05
    d2 = np.einsum("mi,ij,mj->m", z, np.linalg.inv(S), z)
    e = np.where(d2 < gate, p_d * multivariate_normal(np.zeros(2), S).pdf(z) / density, 0.0)
    b = 1.0 - p_d * chi2.cdf(gate, 2)
    found = jpda.associate(x, S[None], z, gate=gate, p_detection=p_d, clutter_density=density)
    assert found.p_miss[0] == pytest.approx(b / (b + e.sum()), abs=1e-12)
    p = np.zeros(5)
    p[found.report] = found.p
    np.testing.assert_allclose(p, e / (b + e.sum()), atol=1e-12)
    assert found.existence[0] == pytest.approx(1.0, abs=1e-12)


def test_existence_equals_enumeration() -> None:
    """Every track exists or not, is seen or not, and takes a report or not: all of it, one by one."""
    rng = np.random.default_rng(8)
    S, gate, density = np.stack([np.diag([4.0, 2.0])] * 3), 12.0, 0.02
    p_d, r = np.array([0.9, 0.7, 0.6]), np.array([0.5, 0.9, 0.05])
    p_g = chi2.cdf(gate, 2)
    for _ in range(10):
        x, z = rng.normal(0.0, 2.0, (3, 2)), rng.normal(0.0, 2.0, (4, 2))
        exists, total = np.zeros(3), 0.0
        likely = np.array([[multivariate_normal(x[i], S[i]).pdf(z[j]) / density for j in range(4)] for i in range(3)])
        inside = np.einsum("nmi,ij,nmj->nm", z - x[:, None], np.linalg.inv(S[0]), z - x[:, None]) < gate
        likely = np.where(inside, likely, 0.0)
        for there in itertools.product((False, True), repeat=3):
            for event in itertools.product(range(-1, 4), repeat=3):
                taken = [j for j in event if j >= 0]
                if len(set(taken)) < len(taken) or any(j >= 0 and not there[i] for i, j in enumerate(event)):
                    continue
                q = 1.0
                for i, j in enumerate(event):
                    seen = p_d[i] * likely[i, j] if j >= 0 else 1.0 - p_d[i] * p_g
                    q *= r[i] * seen if there[i] else 1.0 - r[i]
                total += q
                exists += q * np.array(there)
        found = jpda.associate(x, S, z, gate=gate, p_detection=p_d, clutter_density=density, existence=r)
        np.testing.assert_allclose(found.existence, exists / total, atol=1e-12)


def test_it_can_be_called_from_a_kernel() -> None:
    @njit
    def caller(start, column, weight, miss, m):  # type: ignore[no-untyped-def]
        p, alone, way = np.zeros(len(column)), np.zeros(len(miss)), np.zeros(len(miss), np.int64)
        kernel(start, column, weight, miss, m, 1e5, p, alone, way)
        return p, alone, way

    start = np.array([0, 2, 3, 3])
    p, alone, way = caller(start, np.array([4, 7, 7]), np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.5, 0.5]), 9)
    expected, miss = enumerate_all(np.array([[1.0, 2.0], [0.0, 3.0]]), np.array([0.5, 0.5]))
    np.testing.assert_allclose(p, expected[[0, 0, 1], [0, 1, 1]], atol=1e-14)
    np.testing.assert_allclose(alone, [*miss, 1.0], atol=1e-14)
    assert way.tolist() == [EXACT, EXACT, ALONE]
    assert LOOPY not in way


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(UserError, match="give weights"):
        jpda.marginals(np.ones((2, 2)), np.ones(3))
    with pytest.raises(UserError, match="not negative"):
        jpda.marginals([[-1.0]], [1.0])
    with pytest.raises(UserError, match="neither"):
        jpda.marginals([[0.0]], [0.0])
    x, S, z = np.zeros((1, 2)), np.eye(2)[None], np.zeros((1, 2))
    with pytest.raises(UserError, match="existence within"):
        jpda.associate(x, S, z, gate=9.0, clutter_density=1.0, existence=1.5)
    with pytest.raises(UserError, match="track 0 is not positive"):
        jpda.associate(x, -S, z, gate=9.0, clutter_density=1.0)
    none = jpda.associate(x[:0], S[:0], z, gate=9.0, clutter_density=1.0)
    assert len(none.p_miss) == 0
    empty = jpda.associate(x, S, z[:0], gate=9.0, clutter_density=1.0, existence=0.5)
    assert 0.0 < empty.existence[0] < 0.5
