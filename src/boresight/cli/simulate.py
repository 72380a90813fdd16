"""`boresight simulate`: a scenario to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def simulate(
    scenario: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    seed: int | None = None,
    force: bool = False,
) -> None:
    """Simulate a scenario: targets, platforms and sensors become a recording with truth.

    Parameters
    ----------
    scenario
        SCENARIO.toml; docs/scenarios.md names every key.
    output
        Folder of the recording.
    seed
        Seed of the random numbers; the scenario's own if left out. One seed gives one recording.
    force
        Replace the output folder.
    """
    import numpy as np

    from boresight.config.scenario import read_scenario
    from boresight.io.files import RECORDING, check_output
    from boresight.io.recording import write_recording
    from boresight.sim.scenario import simulate as run

    check_output(output, force, RECORDING, [scenario])
    plan, chosen = read_scenario(scenario, seed)
    recording = run(plan, np.random.default_rng(chosen))
    write_recording(recording, output, force)
    rows, targets = len(recording.detections), len(recording.truth)
    print(f"wrote {output}: {rows} rows of {len(recording.sensors)} sensors, {targets} targets, seed {chosen}")
