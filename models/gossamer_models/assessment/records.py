"""Records of a condition: simulated, or read from what was simulated before, as the sensors would have read them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from ..arrays import Matrix
from ..campaign import measured_resistance, measured_strain, read_campaign, run_campaign
from ..campaign.cases import SENSORS
from .conditions import LATE, Condition, Fault

PAIRS = tuple(combinations(range(SENSORS), 2))


@dataclass(frozen=True, kw_only=True)
class Records:
    """Histories of n cases, whose simulation did not fail.

    Attributes
    ----------
    damage : ndarray, shape (n, 16)
        True damage [1].
    strain : ndarray, shape (n, 4, T)
        What a judge of strain gets [1]; through a chain that of the compensator, without its delay.
    resistance : ndarray, shape (n, 4, T'), or None
        With noise [ohm]; None without a chain.
    step : float
        Sampling step [s].
    failed : int
        Cases that were left out.
    """

    damage: Matrix
    strain: Matrix
    resistance: Matrix | None
    step: float
    failed: int

    def __len__(self) -> int:
        """Return n."""
        return len(self.damage)


def make_records(
    condition: Condition,
    folder: Path,
    *,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Records:
    """Simulate what is missing of a condition and read all of it.

    Parameters
    ----------
    condition : Condition
        What to read.
    folder : Path
        Where the stores of campaigns are.
    workers, progress
        As in ``run_campaign``.

    Raises
    ------
    CampaignStoppedError, DataError, OSError
        As in ``run_campaign``.
    """
    campaign = condition.campaign
    path = folder / f"{condition.store}_{campaign.count}.zarr"
    run_campaign(campaign, path, workers=workers, progress=progress)
    data = read_campaign(path)
    sound = ~data["failed"].to_numpy()
    data = data.isel(case=np.flatnonzero(sound))
    resistance = None
    if campaign.chain is not None:
        late = round(float(data["compensated_strain"].attrs["delay"]) / campaign.step)
        samples = campaign.steps - LATE
        strain = data["compensated_strain"].to_numpy()[:, :, late : late + samples]
        resistance = measured_resistance(data).to_numpy()[:, :, :samples]
    elif condition.noisy:
        strain = measured_strain(data).to_numpy()
    else:
        strain = (data["sensor_gain"] * data["strain"]).to_numpy()
    return Records(
        damage=data["damage"].to_numpy(),
        strain=with_fault(strain, data["case"].to_numpy(), condition.fault),
        resistance=resistance,
        step=campaign.step,
        failed=int((~sound).sum()),
    )


def with_fault(histories: Matrix, numbers: Matrix, fault: Fault) -> Matrix:
    """Return histories, shape (n, 4, T), with one dead sensor or two swapped ones: which, the number of the case tells."""
    found = np.array(histories)
    for k, number in enumerate(numbers):
        if fault == "dead":
            dead = int(number) % SENSORS
            found[k, dead] = found[k, dead, 0]
        elif fault == "swapped":
            pair = list(PAIRS[int(number) % len(PAIRS)])
            found[k, pair] = found[k, pair[::-1]]
    return found
