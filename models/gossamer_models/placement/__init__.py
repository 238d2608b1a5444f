"""Where to put the sensors of a membrane: by the Fisher information of the damage of its zones."""

from .placing import GAUGE_NOISE, NOISE, STEP, STOP, Placement, Placing, place_sensors, sensors_text, write_csv
from .plots import save_picture

__all__ = [
    "GAUGE_NOISE",
    "NOISE",
    "STEP",
    "STOP",
    "Placement",
    "Placing",
    "place_sensors",
    "save_picture",
    "sensors_text",
    "write_csv",
]
