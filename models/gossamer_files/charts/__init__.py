"""Charts: a figure is described once, as data, and drawn by two pens: plotly on a page, matplotlib in a file."""

from .chart import (
    Array,
    Chart,
    Pixels,
    Stages,
    Trace,
    area,
    band,
    bars,
    curve,
    heat,
    names_from_top,
    points,
    rule,
    section,
    with_interval,
    words,
)
from .pen import Panels, draw, draw_panels, save_charts

__all__ = [
    "Array",
    "Chart",
    "Panels",
    "Pixels",
    "Stages",
    "Trace",
    "area",
    "band",
    "bars",
    "curve",
    "draw",
    "draw_panels",
    "heat",
    "names_from_top",
    "points",
    "rule",
    "save_charts",
    "section",
    "with_interval",
    "words",
]
