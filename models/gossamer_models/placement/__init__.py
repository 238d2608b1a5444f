"""Where to put the sensors of a membrane: by the Fisher information of the damage of its zones."""

from .check import Check
from .placing import NOISE, Placement, Placing, place_sensors
from .plots import save_picture
from .tables import sensors_text, write_csv

__all__ = [
    "NOISE",
    "Check",
    "Placement",
    "Placing",
    "place_sensors",
    "save_picture",
    "sensors_text",
    "write_csv",
]
