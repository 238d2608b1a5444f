"""The models of a campaign, and the cases of one chunk run through them, side by side.

Symbols: ``n`` cases of the chunk, ``T`` samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix
from ..batch import Batch
from ..compiler import has_compiler
from ..membrane import membrane_model
from ..membrane.mesh import N_ZONES
from .cases import SENSORS, Cases, draw_cases
from .chain import ChainKernels, chain_kernels, chain_models, run_chain
from .description import NOISE, ONSET, SENSOR_GAIN, Campaign

STRAINS = tuple(f"strain[{i}]" for i in range(1, SENSORS + 1))
DAMAGES = tuple(f"damage[{z}]" for z in range(1, N_ZONES + 1))


@dataclass(frozen=True)
class Kernels:
    """The compiled models of a campaign; they travel to the workers.

    Attributes
    ----------
    membrane : Batch
        Kernel of the membrane.
    chain : ChainKernels or None
        Those of sensor and compensator.
    digests : dict of str
        Digest of each model, by its name.
    """

    membrane: Batch
    chain: ChainKernels | None
    digests: dict[str, str]


def build_kernels(campaign: Campaign) -> Kernels:
    """Build and compile the models of a campaign.

    Raises
    ------
    DescriptionError
        The chain names a parameter that its models do not have.
    GossamerError
        A model or its artifact cannot be used.
    """
    mesh = campaign.membrane
    membrane = membrane_model(mesh.elements_per_side, mesh.order, mesh.law, compiled=has_compiler())
    chain = campaign.chain
    models = () if chain is None else chain_models(chain)
    return Kernels(
        membrane=Batch(membrane, STRAINS, DAMAGES if campaign.begins else ()),
        chain=None if chain is None else chain_kernels(chain, *models),
        digests={model.name: model.digest for model in (membrane, *models)},
    )


def run_chunk(campaign: Campaign, kernels: Kernels, chunk: int) -> dict[str, NDArray[np.generic]]:
    """Simulate the cases of a chunk.

    Parameters
    ----------
    campaign : Campaign
        What to run.
    kernels : Kernels
        Its models.
    chunk : int
        Number of the chunk, from 0.

    Returns
    -------
    dict of ndarray
        By name: ``damage``, shape (n, 16), ``sensor_gain``, shape (n, 4), each quantity that varies, shape (n,),
        ``failed``, shape (n,), and histories ``strain`` [1], with a chain also ``resistance`` [ohm] and
        ``compensated_strain`` [1], shape (n, 4, T), float32. Histories of failed cases are not a number.
    """
    cases = draw_cases(campaign, campaign.numbers(chunk))
    varied = {name: value for name, value in cases.varied.items() if name != NOISE}
    start: dict[str, ArrayLike] = {**campaign.membrane.parameters, **varied, "damage": _damage_at(0.0, cases)}
    run = kernels.membrane.run(campaign.steps, campaign.step, start, _damage_histories(campaign, cases))
    histories, failed = {"strain": run.results}, run.failed
    if kernels.chain is not None:
        more, broken = run_chain(campaign, kernels.chain, cases, run.results)
        histories, failed = histories | more, failed | broken
    return {
        "damage": cases.damage,
        **({ONSET: cases.onset} if campaign.begins else {}),
        SENSOR_GAIN: cases.sensor_gain,
        **cases.varied,
        "failed": failed,
        **{name: np.where(failed[:, None, None], np.nan, h).astype(np.float32) for name, h in histories.items()},
    }


def _damage_at(time: float, cases: Cases) -> Matrix:
    """Return the damage [1] that is there at a time [s], shape (n, 16)."""
    return np.where(cases.onset[:, None] <= time, cases.damage, 0.0)


def _damage_histories(campaign: Campaign, cases: Cases) -> dict[str, ArrayLike]:
    """Return the damage of each zone over the steps, shape (n, T), where it begins within the run."""
    if not campaign.begins:
        return {}
    ends = campaign.step * np.arange(1, campaign.steps + 1)
    there = (
        ends > cases.onset[:, None] + 1e-6 * campaign.step
    )  # from the first step that begins then or later, or holds it
    return {name: np.where(there, cases.damage[:, [zone]], 0.0) for zone, name in enumerate(DAMAGES)}
