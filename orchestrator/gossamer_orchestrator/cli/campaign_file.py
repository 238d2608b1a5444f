"""Read ``campaign.toml``: keys and types are those of ``gossamer_models.campaign.CampaignPlan``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gossamer_models.campaign import CampaignPlan, Chain, Damage, Distribution, MeasurementNoise, Mesh, Vary

from ..scenario.source import Source
from .described_file import read_description

_TABLES: dict[str, type] = {
    "membrane": Mesh,
    "damage": Damage,
    "vary": Vary,
    "noise": MeasurementNoise,
    "strain": Distribution,
    "resistance": Distribution,
    "chain": Chain,
}


def load_campaign(path: Path) -> tuple[CampaignPlan, Source]:
    """Read and check a campaign file.

    Parameters
    ----------
    path : Path
        A TOML file.

    Returns
    -------
    CampaignPlan
        The file of an artifact is relative to the campaign's folder.
    Source
        The text.

    Raises
    ------
    ScenarioError
        The file cannot be read, is not TOML, or has unknown, missing or meaningless keys; one line per mistake.
    """
    campaign, source = read_description(path, "campaign", CampaignPlan, _TABLES)
    if campaign.chain is not None and campaign.chain.artifact is not None:
        artifact = str((path.parent / campaign.chain.artifact).resolve())
        campaign = replace(campaign, chain=replace(campaign.chain, artifact=artifact))
    return campaign, source
