"""100 frames of the phased_array pass through the whole guide filter: `python benchmarks/pointing.py`.

The paper's own chain took 1.125 ms for 100 frames on its machine.
"""

from __future__ import annotations

import timeit

import numpy as np

from boresight.papers.phased_array.modes import FILTER, reports_of
from boresight.papers.phased_array.scenario import LEAD, SCENARIOS, simulate


def main() -> None:
    """Print the best time per 100 nodes (three sources each) for every scenario."""
    for name, scenario in SCENARIOS.items():
        one = simulate(scenario, np.random.default_rng(1))
        reports = reports_of(one)
        FILTER.run(reports, one.node, one.node + LEAD)
        best = min(timeit.repeat(lambda: FILTER.run(reports, one.node, one.node + LEAD), number=1, repeat=20))  # noqa: B023
        print(f"{name:8s} {len(reports.t)} reports: {best / len(one.node) * 1e5:.2f} ms per 100 nodes")


if __name__ == "__main__":
    main()
