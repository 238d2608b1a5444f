"""Inspections of the square: four records in place of one, and what has grown since the last one.

``python -m studies.history [CASES] [NOISE]`` from the folder ``docs`` prints a line for each. The truth has elements of
order 6, and the error of the twin's mesh was learned of order 8. Each case has two damaged zones of 10 to 50 %, four records
under loads that are off by 5 % (deviation), and two later ones in which one of the zones has 3 points more.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from gossamer_models.membrane import square_structure
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin, inspect
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP, SAMPLES, TRUTH = 3e-4, 1000, (4, 6)
RECORDS, LATER, GROWN = 4, 2, 0.03
SEEN = 0.95  # probability of growth that is taken for seen


def main() -> None:
    """Print the lines."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    noise = float(sys.argv[2]) if len(sys.argv) > 2 else 1e-3
    random, twin, forward = np.random.default_rng(11), Twin(), MembraneForward(square_structure(*TRUTH))

    def record(damage: Array) -> ResponseRecord:
        load = 1.0 + 0.05 * random.standard_normal()
        amplitude = np.array([load * forward.parameters["pressure_amplitude"]])
        y = forward.strain(damage[None], {"pressure_amplitude": amplitude}, {}, SAMPLES, STEP)[0]
        return ResponseRecord(step=STEP, values=y + noise * random.standard_normal(y.shape))

    ratios, z, valid, seen, false, growth, seconds = [], [], 0, 0, 0, list[float](), 0.0
    for case in range(cases):
        damage = np.zeros(16)
        torn = random.choice(16, 2, replace=False)
        damage[torn] = random.uniform(0.1, 0.5, 2)
        records = [record(damage) for _ in range(RECORDS)]
        one, begun = twin.fit(records[0]), time.process_time()
        four = inspect(twin, records)
        seconds += time.process_time() - begun
        ratios.append(four.deviation[torn] / one.deviation[torn])
        z.append((four.damage - damage)[torn] / four.deviation[torn])
        valid += four.valid
        later = damage.copy()
        later[torn[0]] += GROWN
        if not four.valid:
            print(f"case {case}: {'; '.join(four.doubts)}", flush=True)
            continue
        then = inspect(twin, [record(later) for _ in range(LATER)], since=four)
        assert then.growth is not None
        assert then.growth_probability is not None
        assert then.growth_deviation is not None
        found = then.growth_probability > SEEN
        seen += int(found[torn[0]] and then.valid)
        false += int(np.delete(found, torn[0]).sum()) * then.valid
        growth.append(float((then.growth[torn[0]] - GROWN) / then.growth_deviation[torn[0]]))
        print(
            f"case {case}: grown {100.0 * then.growth[torn[0]]:.2f} +- {100.0 * then.growth_deviation[torn[0]]:.2f} %, "
            f"valid {then.valid}",
            flush=True,
        )
    rms = float(np.sqrt(np.mean(np.square(z))))
    print(
        f"noise {noise:g}, four records: {np.mean(ratios):.2f} of the deviation of one, z {rms:.2f}, {valid} of {cases} "
        f"valid, {seconds / cases:.0f} s of CPU"
    )
    z_grown = np.sqrt(np.mean(np.square(growth)))
    print(
        f"noise {noise:g}, {100.0 * GROWN:g} points more: seen {seen} of {cases}, z {z_grown:.2f}; "
        f"{false} of {15 * cases} zones falsely"
    )


if __name__ == "__main__":
    main()
