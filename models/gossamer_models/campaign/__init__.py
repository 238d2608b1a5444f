"""Campaigns: many cases of damage, load, material and sensors, a function of a seed, in a store that can be resumed."""

from .cases import Cases, draw_cases
from .cluster import CampaignStoppedError
from .description import Campaign, Chain, Damage, Mesh, Noise
from .measured import measured_resistance, measured_strain
from .ranges import Distribution, Vary
from .run import Summary, run_campaign
from .store import read_campaign

__all__ = [
    # what to run
    "Campaign",
    "Chain",
    "Damage",
    "Distribution",
    "Mesh",
    "Noise",
    "Vary",
    # run it
    "CampaignStoppedError",
    "Cases",
    "draw_cases",
    "run_campaign",
    "Summary",
    # use it
    "measured_resistance",
    "measured_strain",
    "read_campaign",
]
