"""Plots of a run: every ``plot_*`` draws into one ``Axes`` and returns it; ``save_pictures`` writes the usual pages.

To add a plot, write its function in the file of its theme, and its page at the end of that file.
"""

from .damage import plot_damage_history, plot_damage_map
from .deflection import plot_deflection, plot_deflection_history, plot_shape
from .save import save_pictures
from .sensors import plot_sensor_loop, plot_strain, plot_strain_error

__all__ = [
    "plot_damage_history",
    "plot_damage_map",
    "plot_deflection",
    "plot_deflection_history",
    "plot_sensor_loop",
    "plot_shape",
    "plot_strain",
    "plot_strain_error",
    "save_pictures",
]
