"""100 frames of the phased_array pass, from reports to angles of the face: `python benchmarks/pointing.py`.

The paper's own chain took 1.125 ms for 100 frames on its machine.
"""

from __future__ import annotations

import timeit

import numpy as np

from boresight.frames.array_face import angles_from_face
from boresight.papers.phased_array.modes import FILTER, filtered, reports_of
from boresight.papers.phased_array.scenario import LEAD, SCENARIOS, simulate


def main() -> None:
    """Print the best time per 100 nodes (three sources each) for every scenario: the filter, and all of it."""
    for name, scenario in SCENARIOS.items():
        one = simulate(scenario, np.random.default_rng(1))
        reports = reports_of(one)

        def chain() -> None:
            enu = filtered(one)  # noqa: B023
            begun = np.isfinite(enu[:, 0])  # not before the first report
            angles_from_face(np.einsum("nji,nj->ni", one.face_measured[begun], enu[begun]), one.pole)  # noqa: B023

        chain()
        k = len(one.node)
        run = timeit.repeat(lambda: FILTER.run(reports, one.node, one.node + LEAD), number=1, repeat=200)  # noqa: B023
        whole = timeit.repeat(chain, number=1, repeat=200)
        told = " ".join(f"{what} {min(s) / k * 1e5:.2f} ms" for what, s in (("filter", run), ("whole chain", whole)))
        print(f"{name:8s} {len(reports.t)} reports, per 100 nodes: {told}")


if __name__ == "__main__":
    main()
