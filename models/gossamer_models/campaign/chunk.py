"""The models of a campaign, and the cases of one chunk run through them, side by side: membrane, sensors, compensators.

Symbols: ``n`` cases of the chunk, ``T`` samples. A sensor is a lane of its kernel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..compensator import compensator_model
from ..membrane import membrane_model
from ..mistakes import Mistake, raise_any
from ..sensor import SensorArtifact, default_artifact, sensor_model
from .cases import Cases, draw_cases, sensor_errors, unit_noise
from .description import LOAD, NOISE, ONSET, SENSOR_ERROR, SENSOR_GAIN, CampaignPlan, Chain

FULL_SCALE = "full_scale_resistance_change"


@dataclass(frozen=True)
class ChainKernels:
    """The compiled sensor and compensator of a campaign.

    Attributes
    ----------
    sensor, compensator : Batch
        Kernels.
    settings : Chain
        What the campaign asks for.
    full_scale_change : float
        Change of resistance at full scale [ohm] of a sensor of gain 1.
    """

    sensor: Batch
    compensator: Batch
    settings: Chain
    full_scale_change: float


def chain_kernels(chain: Chain) -> tuple[ChainKernels, dict[str, str]]:
    """Build and compile sensor and compensator; return the digest of each, too.

    Raises
    ------
    DescriptionError
        There is no such parameter.
    GossamerError
        The artifact cannot be read, or the compensator cannot follow its sensor.
    """
    artifact = default_artifact() if chain.artifact is None else SensorArtifact.read(Path(chain.artifact))
    sensor, compensator = sensor_model(artifact), compensator_model(artifact, chain.compensator)
    mistakes = []
    for model, table in ((sensor, "sensor_parameters"), (compensator, "compensator_parameters")):
        known = tuple(v.name for v in model.variables if v.causality == "parameter")
        for name in getattr(chain, table):
            if name not in known:
                text = f"the {model.name} has no parameter {name!r}."
                mistakes.append(Mistake(("chain", table, name), text, name, known))
    raise_any(mistakes)
    starts = {v.name: v.start for v in sensor.variables if v.start is not None}
    kernels = ChainKernels(
        sensor=Batch(sensor, ("resistance",), ("strain",)),
        compensator=Batch(compensator, ("strain",), ("resistance",)),
        settings=chain,
        full_scale_change=float({**starts, **chain.sensor_parameters}[FULL_SCALE]),
    )
    return kernels, {model.name: model.digest for model in (sensor, compensator)}


def run_chain(
    campaign: CampaignPlan, kernels: ChainKernels, cases: Cases, rest: tuple[Matrix, Matrix], strain: Matrix
) -> tuple[dict[str, Matrix], NDArray[np.bool_]]:
    """Turn strain into resistance and back.

    Parameters
    ----------
    campaign : CampaignPlan
        What is run.
    kernels : ChainKernels
        Its sensor and compensator.
    cases : Cases
        Cases of the chunk.
    rest : tuple of ndarray, shapes (n, sensors) and (1, sensors)
        Strain [1] at which the sensors of each case rest, and at which their compensators assume that they do.
    strain : ndarray, shape (n, sensors, T)
        Strain of the membrane [1]; not a number where that failed.

    Returns
    -------
    dict of ndarray, shape (n, sensors, T)
        ``resistance`` [ohm] without noise and ``compensated_strain`` [1], with the noise of draw 0.
    ndarray of bool, shape (n,)
        Cases that failed.

    Notes
    -----
    The gain of a sensor multiplies its change of resistance, and its error is in the strain that it feels; its compensator
    knows neither.
    """
    failed: NDArray[np.bool_] = np.asarray(np.isnan(strain).any(axis=(1, 2)))
    own, assumed = (np.broadcast_to(part, strain.shape[:2]) for part in rest)
    usable = np.where(failed[:, None, None], own[:, :, None], strain)
    sensors: dict[str, ArrayLike] = {
        "rest_strain": own.ravel(),
        **kernels.settings.sensor_parameters,
        FULL_SCALE: kernels.full_scale_change * cases.sensor_gain.ravel(),
    }
    felt = usable + sensor_errors(cases.sensor_error, usable, campaign.seed, cases.numbers)
    resistance, broken = _run(campaign, kernels.sensor, sensors, "strain", felt)
    failed |= broken
    noise = unit_noise(campaign.noise.resistance, "resistance", (campaign.seed, 0), cases.numbers, strain.shape[1:])
    scale = kernels.full_scale_change * np.reshape(cases.varied.get(NOISE, 1.0), (-1, 1, 1))
    noisy = np.where(failed[:, None, None], 0.0, resistance + scale * noise)
    start: dict[str, ArrayLike] = {"rest_strain": assumed.ravel(), **kernels.settings.compensator_parameters}
    compensated, broken = _run(campaign, kernels.compensator, start, "resistance", noisy)
    return {"resistance": resistance, "compensated_strain": compensated}, failed | broken


def rest_strain(campaign: CampaignPlan, kernel: Batch, varied: Mapping[str, Vector]) -> Matrix:
    """Return the strain [1] of an undamaged membrane at rest, shape (n, sensors), of every case or, without any, of one."""
    zones = campaign.membrane.structure.n_zones
    start: dict[str, ArrayLike] = {**campaign.membrane.parameters, **varied, "damage": np.zeros(zones)}
    return kernel.run(0, campaign.step, start, dict.fromkeys(kernel.inputs, np.zeros(0))).initial


def _run(
    campaign: CampaignPlan, kernel: Batch, start: Mapping[str, ArrayLike], name: str, signal: Matrix
) -> tuple[Matrix, NDArray[np.bool_]]:
    """Run a signal, shape (n, sensors, T), through sensors or compensators; return the result and which cases failed."""
    run = kernel.run(campaign.steps, campaign.step, start, {name: signal.reshape(-1, signal.shape[-1])})
    failed: NDArray[np.bool_] = np.asarray(run.failed.reshape(signal.shape[:2]).any(axis=1))
    return np.reshape(run.results, signal.shape), failed


@dataclass(frozen=True)
class Kernels:
    """The compiled models of a campaign; they travel to the workers.

    Attributes
    ----------
    membrane : Batch
        Kernel of the membrane.
    finer : Batch or None
        The same with finer elements, if some chunks run on them.
    zones : int
        Number of its zones.
    chain : ChainKernels or None
        Those of sensor and compensator.
    digests : dict of str
        Digest of each model, by its name.
    """

    membrane: Batch
    finer: Batch | None
    zones: int
    chain: ChainKernels | None
    digests: dict[str, str]


def build_kernels(campaign: CampaignPlan) -> Kernels:
    """Build and compile the models of a campaign.

    Raises
    ------
    DescriptionError
        The chain names a parameter that its models do not have.
    GossamerError
        A model or its artifact cannot be used.
    """
    structure = campaign.membrane.structure
    models = [membrane_model(each) for each in (structure, *([structure.finer()] if campaign.membrane.finer else []))]
    begun = models[0].elements("damage") if campaign.begins else ()
    own, *finer = (Batch(each, each.elements("strain"), (*begun, *campaign.membrane.histories)) for each in models)
    chain, digests = (None, {}) if campaign.chain is None else chain_kernels(campaign.chain)
    return Kernels(
        membrane=own,
        finer=finer[0] if finer else None,
        zones=structure.n_zones,
        chain=chain,
        digests={models[0].name: models[0].digest, **{f"finer {each.name}": each.digest for each in models[1:]}, **digests},
    )


def run_chunk(campaign: CampaignPlan, kernels: Kernels, chunk: int) -> dict[str, NDArray[np.generic]]:
    """Simulate the cases of a chunk.

    Parameters
    ----------
    campaign : CampaignPlan
        What to run.
    kernels : Kernels
        Its models.
    chunk : int
        Number of the chunk, from 0.

    Returns
    -------
    dict of ndarray
        By name: ``damage``, shape (n, zones), ``sensor_gain``, shape (n, sensors), each quantity that varies, ``failed``
        and, where some are, ``finer``, shape (n,), and histories ``strain`` [1], with a chain also ``resistance`` [ohm] and
        ``compensated_strain`` [1], shape (n, sensors, T), float32. Histories of failed cases are not a number.
    """
    cases = draw_cases(campaign, campaign.numbers(chunk))
    varied = {name: value for name, value in cases.varied.items() if name not in (NOISE, LOAD)}
    first, acting = acting_on(campaign, cases)
    there = np.where(cases.onset[:, None] <= 0.0, cases.damage, 0.0)
    start: dict[str, ArrayLike] = {**campaign.membrane.parameters, **first, **varied, "damage": there}
    kernel = kernels.finer if kernels.finer is not None and campaign.membrane.is_finer(chunk) else kernels.membrane
    run = kernel.run(campaign.steps, campaign.step, start, _damage_histories(campaign, cases) | acting)
    histories, failed = {"strain": run.results}, run.failed
    if kernels.chain is not None:
        rest = rest_strain(campaign, kernel, varied), rest_strain(campaign, kernels.membrane, {})
        more, broken = run_chain(campaign, kernels.chain, cases, rest, run.results)
        histories, failed = histories | more, failed | broken
    return {
        "damage": cases.damage,
        **({ONSET: cases.onset} if campaign.begins else {}),
        SENSOR_GAIN: cases.sensor_gain,
        **({SENSOR_ERROR: cases.sensor_error} if SENSOR_ERROR in campaign.vary else {}),
        **cases.varied,
        "failed": failed,
        **({} if kernels.finer is None else {"finer": np.full(len(failed), kernel is kernels.finer)}),
        **{name: np.where(failed[:, None, None], np.nan, h).astype(np.float32) for name, h in histories.items()},
    }


def acting_on(campaign: CampaignPlan, cases: Cases) -> tuple[dict[str, ArrayLike], dict[str, ArrayLike]]:
    """Return the inputs that change over time, of each case: at the start, shape (n,), and over the steps, shape (n, T)."""
    if campaign.membrane.load is None:
        return {}, {}
    loads = campaign.membrane.load.loads(campaign.steps, campaign.step)
    factor = np.broadcast_to(cases.varied.get(LOAD, 1.0), len(cases.numbers))
    first, acting = (
        {name: np.multiply.outer(factor, load) for name, load in each.items()} for each in (loads.start, loads.histories)
    )
    return first, acting


def _damage_histories(campaign: CampaignPlan, cases: Cases) -> dict[str, ArrayLike]:
    """Return the damage of each zone over the steps, shape (n, T), where it begins within the run."""
    if not campaign.begins:
        return {}
    ends = campaign.step * np.arange(1, campaign.steps + 1)
    there = ends > cases.onset[:, None] + 1e-6 * campaign.step  # from the first step that begins then or later, or holds it
    return {f"damage[{zone}]": np.where(there, d[:, None], 0.0) for zone, d in enumerate(cases.damage.T, start=1)}
