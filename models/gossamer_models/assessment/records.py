"""Records that judges are asked about, with their truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import campaign as campaigns
from ..arrays import Matrix
from ..campaign.cases import unit_noise
from ..twin.forward import MembraneForward
from .conditions import LATE, Condition
from .truths import whole_zones

FEW = 64  # cases that are simulated at once: processes of a campaign take longer to begin


@dataclass(frozen=True, kw_only=True)
class Records:
    """Histories of n cases, whose simulation did not fail.

    Attributes
    ----------
    damage : ndarray, shape (n, zones)
        True damage [1].
    strain : ndarray, shape (n, sensors, T)
        What a judge of strain gets [1]; through a chain that of the compensator, without its delay.
    resistance : ndarray, shape (n, sensors, T'), or None
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


def make_records(condition: Condition, folder: Path, *, workers: int | None = None) -> Records:
    """Simulate what is missing of a condition and read all of it.

    Parameters
    ----------
    condition : Condition
        What to read.
    folder : Path
        Where the stores of campaigns are.
    workers
        As in ``run_campaign``.

    Raises
    ------
    CampaignStoppedError, DataError, OSError
        As in ``run_campaign``.
    """
    campaign, resistance = condition.campaign, None
    if campaign.chain is None and (condition.loads is not None or campaign.count <= FEW):
        cases, strain, noise = _simulated(condition)
        sound = np.isfinite(strain).all(axis=(1, 2))
        numbers, damage, strain, noise = np.array(cases.numbers)[sound], cases.damage[sound], strain[sound], noise[sound]
    else:
        path = folder / f"{condition.store}_{campaign.count}.zarr"
        campaigns.run_campaign(campaign, path, workers=workers)
        data = campaigns.read_campaign(path)
        sound = ~data["failed"].to_numpy()
        data = data.isel(case=np.flatnonzero(sound))
        numbers, damage = data["case"].to_numpy(), data["damage"].to_numpy()
        strain = (data["sensor_gain"] * data["strain"]).to_numpy()
        noise = campaigns.measured_strain(data).to_numpy() - strain if condition.noisy else 0.0 * strain
        if campaign.chain is not None:
            late = round(float(data["compensated_strain"].attrs["delay"]) / campaign.step)
            samples = campaign.steps - LATE
            strain = data["compensated_strain"].to_numpy()[:, :, late : late + samples]
            noise = 0.0 * strain
            resistance = campaigns.measured_resistance(data).to_numpy()[:, :, :samples]
    return Records(
        damage=whole_zones(campaign.membrane.structure, damage) if condition.parts else damage,
        strain=condition.read(strain, noise, numbers),
        resistance=resistance,
        step=campaign.step,
        failed=int((~sound).sum()),
    )


def _simulated(condition: Condition) -> tuple[campaigns.Cases, Matrix, Matrix]:
    """Simulate few cases, or loads of their own, which no campaign has; return the cases, strain and noise."""
    campaign = condition.campaign
    cases = campaigns.draw_cases(campaign, range(campaign.count))
    varied = {name: values for name, values in cases.varied.items() if name in campaign.membrane.settable}
    loads = {} if condition.loads is None else condition.loads(campaign)
    forward = MembraneForward(campaign.membrane.structure, campaign.membrane.parameters)
    strain = forward.strain(cases.damage, varied, loads, campaign.steps, campaign.step)
    law = campaign.noise.strain if condition.noisy else None
    noise = unit_noise(law, "strain", (campaign.seed, 0), cases.numbers, strain.shape[1:])
    return cases, cases.sensor_gain[:, :, None] * strain, noise
