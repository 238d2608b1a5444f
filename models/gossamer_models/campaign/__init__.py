"""Campaigns: many cases of damage, load, material and sensors, a function of a seed, in a store that can be resumed."""

from .cases import Cases, draw_cases, measured_resistance, measured_strain
from .defaults import campaign_of_setup
from .description import (
    LOAD,
    OF_NO_VARIABLE,
    SENSOR_ERROR,
    SENSOR_GAIN,
    CampaignPlan,
    Chain,
    Coarser,
    Damage,
    Distribution,
    MeasurementNoise,
    Vary,
)
from .mesh import Mesh
from .run import CampaignStoppedError, Summary, run_campaign
from .store import read_campaign

__all__ = [
    # what to run
    "campaign_of_setup",
    "CampaignPlan",
    "Chain",
    "Coarser",
    "Damage",
    "Distribution",
    "LOAD",
    "Mesh",
    "OF_NO_VARIABLE",
    "SENSOR_ERROR",
    "SENSOR_GAIN",
    "MeasurementNoise",
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
