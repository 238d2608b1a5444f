"""The pen of files: charts drawn by matplotlib as PNG, SVG or PDF. It knows the traces of ``charts``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from textwrap import fill, shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from .charts import Array, Chart, Trace
from .pictures import COLORS, GREY, axes_or_new, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMED = {"ink": "black", "grey": GREY, "alarm": "#B34700"}
SCALES = {"@damage": "Blues", "@unsure": "Greys", "@signed": "PuOr_r"}
DASHES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
SYMBOLS = {"circle": "o", "square": "s", "diamond": "D", "diamond-open": "D", "triangle-up": "^", "triangle-down": "v"}
SYMBOLS |= {"x": "x", "x-thin-open": "x", "line-ew-open": "_", "line-ns-open": "|"}
LEAST_SPAN = 1e-4  # of an axis, in shares of the values
STEPS = [1, 2, 2.5, 5, 10]  # of ticks, but for powers of ten
LONGEST_TITLE = 120  # characters that fit above a picture
WORDS_WIDTH = 12  # characters of a line above a picture, for each inch


@dataclass(frozen=True)
class Panels:
    """Charts beside each other in one file.

    Attributes
    ----------
    charts : sequence of Chart
        Row by row.
    size : tuple of float
        Width and height of the figure [inch].
    columns : int
        How many are beside each other.
    heights : sequence of float
        Shares of the rows, repeated until the last.
    title : str
        Above all of them.
    shared : bool
        Whether they have the same axes, and one legend.
    """

    charts: Sequence[Chart]
    size: tuple[float, float] = (7.0, 5.0)
    columns: int = 1
    heights: Sequence[float] = (1.0,)
    title: str = ""
    shared: bool = False


def save_charts(pictures: Mapping[str, Chart | Panels], folder: Path, form: str = "png") -> list[Path]:
    """Write charts by the names of their files, without a display; return the paths.

    Parameters
    ----------
    pictures : mapping of str to Chart or Panels
        Name of the file, without its ending, to what stands in it.
    folder : Path
        Where to; made if needed.
    form : {"png", "svg", "pdf"}
        Form of the files.
    """
    paths = []
    for name, each in pictures.items():
        paths.append(folder / f"{name}.{form}")
        panels = each if isinstance(each, Panels) else Panels([each])
        with picture(paths[-1], panels.size) as figure:
            draw_panels(panels, figure)
    return paths


def draw_panels(panels: Panels, figure: Figure) -> None:
    """Draw charts into a figure, row by row."""
    rows, shared = -(-len(panels.charts) // panels.columns), panels.shared
    heights = [panels.heights[k % len(panels.heights)] for k in range(rows)]
    grid: Any = {"squeeze": False, "height_ratios": heights, "sharex": shared, "sharey": shared}
    axes = figure.subplots(rows, panels.columns, **grid).ravel()
    many = shared or len(panels.charts) > 2
    for ax, chart in zip(axes, panels.charts, strict=False):
        draw(chart, ax, legend=not many)
        if shared:
            ax.label_outer()
    for ax in axes[len(panels.charts) :]:
        ax.set_axis_off()
    pairs = [zip(*ax.get_legend_handles_labels(), strict=True) for ax in axes]
    named = {label: handle for some in pairs for handle, label in some}
    if many and named:
        figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=min(len(named), 4))
    if panels.title:
        figure.suptitle(shorten(panels.title, LONGEST_TITLE), parse_math=False)


def draw(chart: Chart, ax: Axes | None = None, *, legend: bool = True) -> Axes:
    """Draw a chart, of one that changes its last step, into axes or into those of a new figure."""
    ax = axes_or_new(ax)
    traces = [*chart.traces, *(chart.steps.traces[-1] if chart.steps and len(chart.steps.traces) else ())]
    axes = {which: dict(chart.layout.get(f"{which}axis", {})) for which in "xy"}
    places = {which: _places(traces, axes[which], which) for which in "xy"}
    for mark in chart.marks:
        _mark(mark, ax)
    grouped = [trace for trace in traces if trace["type"] == "bar" and chart.layout.get("barmode") == "group"]
    low: Array = np.zeros(0)
    for trace in traces:
        trace = {"showlegend": chart.layout.get("showlegend", True)} | trace
        x, y = (_placed(trace[which], places[which]) for which in "xy")
        if trace["type"] in ("heatmap", "contour"):
            _map(trace, x, y, ax)
        elif trace["type"] == "bar":
            beside = [each is not None and each["name"] == trace["name"] for each in grouped]
            _bars(trace, x, y, (beside.index(True), len(beside)) if len(beside) > 1 else (0, 1), ax)
        elif trace["mode"] == "text":
            _words(trace, x, y, ax)
        else:
            _scatter(trace, x, y, low, ax)
            low = y
    for which in "xy":
        if places[which]:
            getattr(ax, f"set_{which}ticks")(range(len(places[which])), list(places[which]))
        else:
            _scale(axes[which], which, ax, is_time=chart.x.startswith("time"))
    if "scaleanchor" in axes["y"]:
        ax.set_aspect("equal")
    ax.set_xlabel(chart.x, parse_math=False)
    ax.set_ylabel(chart.y, parse_math=False)
    said = ": ".join(filter(None, (chart.title, chart.result)))
    room = int(WORDS_WIDTH * _width(ax))
    lines = [said] if len(said) <= room else [chart.title, chart.result]
    ax.set_title("\n".join(fill(line, room) for line in lines if line), parse_math=False)
    if legend:
        _legend(ax)
    return ax


def _width(ax: Axes) -> float:
    """Return about how broad the axes are [inch]."""
    return float(ax.figure.bbox.width / ax.figure.dpi * ax.get_position().width / 0.8)


def _legend(ax: Axes) -> None:
    """Put the legend below the axes, where it hides nothing, in as many columns as find place."""
    handles, labels = ax.get_legend_handles_labels()
    if not labels:
        return
    from matplotlib.transforms import ScaledTranslation

    room, widths = _width(ax), [0.5 + 0.07 * len(label) for label in labels]  # [inch]
    columns = len(labels) if sum(widths) <= room else max(1, int(room / max(widths)))
    below = ax.transAxes + ScaledTranslation(0.0, -0.48, ax.figure.dpi_scale_trans)
    place: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "bbox_transform": below}
    for text in ax.legend(handles, labels, ncols=columns, borderaxespad=0.0, **place).get_texts():
        text.set_parse_math(False)


def _color(name: Any) -> Any:  # noqa: ANN401
    """Return a colour of matplotlib for one by name."""
    if isinstance(name, (list, tuple)):
        return [_color(each) for each in name]
    plain, _, share = str(name).removeprefix("@").partition("/")
    if plain == "over":
        return "white" if float(share) > 0.55 else "black"
    color = COLORS[int(plain) % len(COLORS)] if plain.isdigit() else NAMED.get(plain, plain)
    return (color, float(share)) if share else color


def _label(trace: Trace) -> str | None:
    return str(trace["name"]) if trace["showlegend"] and trace.get("name") else None


def _places(traces: Sequence[Trace], axis: Mapping[str, Any], which: str) -> dict[str, int]:
    """Return the numbers of the words along an axis; there are none along one of numbers."""
    names = list(axis.get("categoryarray", ()))
    for trace in traces:
        names += [str(each) for each in trace[which] if isinstance(each, str)]
    return {name: place for place, name in enumerate(dict.fromkeys(names))}


def _placed(values: Any, places: Mapping[str, int]) -> Array:  # noqa: ANN401
    return np.array([places[str(each)] for each in values], dtype=float) if places else np.asarray(values, dtype=float)


def _mark(mark: Trace, ax: Axes) -> None:
    line = mark["line"]
    if mark["type"] == "rect":
        ax.axvspan(mark["x0"], mark["x1"], color=_color(mark["fillcolor"]), lw=0)
        return
    look = {"color": _color(line["color"]), "lw": 0.8 * line["width"], "ls": DASHES[line.get("dash", "solid")]}
    if mark["xref"] == "x":
        ax.axvline(mark["x0"], **look)
    else:
        ax.axhline(mark["y0"], **look)


def _map(trace: Trace, x: Array, y: Array, ax: Axes) -> None:
    """Draw a map of colours with its scale: cells about their places, or levels between these."""
    limits: Any
    z, limits = np.asarray(trace["z"], dtype=float), {"vmin": trace.get("zmin"), "vmax": trace.get("zmax")}
    colors = SCALES.get(trace["colorscale"], str(trace["colorscale"]).lower().replace("rdbu", "RdBu"))
    ax.grid(visible=False)
    if trace["type"] == "contour":
        image: Any = ax.contourf(x, y, z, levels=16, cmap=colors, **limits)
        ax.contour(x, y, z, levels=16, colors="white", linewidths=0.3, alpha=0.6)
    else:
        image = ax.pcolormesh(_edges(x), _edges(y), z, cmap=colors, rasterized=True, **limits)
    if trace.get("xgap"):
        image.set_edgecolor("white")
    if trace.get("showscale", True):
        bar = ax.figure.colorbar(image, ax=ax)
        bar.set_label(trace["colorbar"].get("title", {}).get("text", ""), parse_math=False)


def _edges(centres: Array) -> Array:
    if len(centres) < 2:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    middle = (centres[1:] + centres[:-1]) / 2.0
    return np.concatenate([[2.0 * centres[0] - middle[0]], middle, [2.0 * centres[-1] - middle[-1]]])


def _errors(trace: Trace, axis: str) -> Array | None:
    found = trace.get(f"error_{axis}")
    if not found:
        return None
    above = np.nan_to_num(np.asarray(found["array"], dtype=float))
    reach: Array = np.maximum(np.stack([np.nan_to_num(np.asarray(found.get("arrayminus", above), dtype=float)), above]), 0.0)
    return reach


def _bars(trace: Trace, x: Array, y: Array, beside: tuple[int, int], ax: Axes) -> None:
    lying, (k, count) = trace.get("orientation") == "h", beside
    at, values = (y, x) if lying else (x, y)
    step = float(np.diff(np.unique(at)).min()) if np.unique(at).size > 1 else 1.0
    width = 0.8 * step / count
    at = at + (k - (count - 1) / 2.0) * width * (-1.0 if lying else 1.0)
    draw_bars = ax.barh if lying else ax.bar
    draw_bars(at, values, width, color=_color(trace["marker"]["color"]), label=_label(trace))
    for axis in "xy":
        if (reach := _errors(trace, axis)) is not None:
            look: Any = {"fmt": "none", "ecolor": _color(trace[f"error_{axis}"]["color"]), "elinewidth": 1.0, "capsize": 2.0}
            ax.errorbar(values if lying else at, at if lying else values, **{f"{axis}err": reach} | look)


def _words(trace: Trace, x: Array, y: Array, ax: Axes) -> None:
    colors, size = _color(trace["textfont"]["color"]), 0.65 * trace["textfont"]["size"]
    for k, text in enumerate(trace["text"]):
        plain = re.sub("<[^>]*>", "", str(text).replace("<br>", "\n"))
        color = colors[k] if isinstance(colors, list) else colors
        ax.text(x[k], y[k], plain, ha="center", va="center", color=color, fontsize=size, parse_math=False)


def _scatter(trace: Trace, x: Array, y: Array, low: Array, ax: Axes) -> None:
    """Draw a curve, points, both, the area between two curves, or areas within closed ones."""
    line, marker = trace.get("line", {}), trace.get("marker", {})
    style = "post" if line.get("shape") == "hv" else None
    if trace.get("fill") == "tonexty":
        color = _color(trace["fillcolor"])
        ax.fill_between(x, low, y, color=color, lw=0, step="post" if style else None, label=_label(trace))
    elif trace.get("fill") == "toself":
        ax.fill(*_closed(x, y), color=_color(trace["fillcolor"]), lw=0.4)
    elif marker.get("showscale"):
        _colour_scale(marker, ax)
    elif "lines" in trace["mode"] and line.get("width", 1.3) == 0:
        pass  # the edge of a band
    else:
        look: dict[str, Any] = {"color": _color(line.get("color", marker.get("color"))), "label": _label(trace), "ls": ""}
        if "lines" in trace["mode"]:
            look |= {"ls": DASHES[line.get("dash", "solid")], "lw": 0.8 * line.get("width", 1.5)}
            look |= {"drawstyle": "steps-post"} if style else {}
        if "markers" in trace["mode"]:
            symbol = marker.get("symbol", "circle")
            look |= {"marker": SYMBOLS[symbol], "ms": 0.7 * float(np.max(marker.get("size", 6))), "clip_on": False}
            look |= {"mfc": "none"} if symbol.endswith("open") else {}
        reach: Any = {f"{axis}err": each for axis in "xy" if (each := _errors(trace, axis)) is not None}
        if reach:
            ax.errorbar(x, y, **reach, **look, elinewidth=1.0, capsize=2.0)
        else:
            ax.plot(x, y, **look)


def _closed(x: Array, y: Array) -> list[Array]:
    """Return the polygons that are apart by a point that is not a number, x and y in turn."""
    ends = [-1, *np.flatnonzero(np.isnan(x)), len(x)]
    return [each[a + 1 : b] for a, b in pairwise(ends) if b > a + 1 for each in (x, y)]


def _colour_scale(marker: Trace, ax: Axes) -> None:
    """Draw the scale of colours that areas were painted by."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    name = str(marker["colorscale"]).lower() + "_r" * bool(marker.get("reversescale"))
    bar, colors = marker["colorbar"], ScalarMappable(Normalize(*marker["color"]), name)
    scale = ax.figure.colorbar(colors, ax=ax, label=bar["title"]["text"], shrink=0.85)
    scale.set_ticks(bar["tickvals"], labels=bar["ticktext"])


def _scale(axis: Mapping[str, Any], which: str, ax: Axes, *, is_time: bool) -> None:
    """Scale an axis as its layout says, with few and short numbers at its ticks."""
    from matplotlib import rc_context
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    found = ax.xaxis if which == "x" else ax.yaxis
    if axis.get("type") == "log":
        getattr(ax, f"set_{which}scale")("log")
    elif axis.get("type") != "category":
        low, high = found.get_view_interval()
        room = 0.5 * max(0.0, LEAST_SPAN * max(abs(low), abs(high)) - (high - low))
        if room:  # values that hardly differ are one
            ax.set(**{f"{which}lim": (low - room, high + room)})
        is_long = which == "x" and not is_time and high - low + 2.0 * room < 1e-2 * max(abs(low), abs(high))
        found.set_major_locator(MaxNLocator(2 if is_long else 6 if which == "x" else 5, steps=STEPS))
        if which == "x" and not is_time:
            ax.ticklabel_format(axis="x", style="plain", useOffset=False)
        else:
            with rc_context({"axes.formatter.offset_threshold": 2}):  # what all numbers share is written once
                short = ScalarFormatter(useMathText=True)
            short.set_powerlimits((-2, 5))
            found.set_major_formatter(short)
    if "tickvals" in axis:
        getattr(ax, f"set_{which}ticks")(axis["tickvals"], axis.get("ticktext"), minor=False)
        found.set_minor_formatter("")
    elif axis.get("dtick") == 1 and axis.get("type") != "log":
        place = ax.get_subplotspec()
        most = min(20, 40 // place.get_gridspec().ncols) if place else 20
        low, high = found.get_data_interval()
        ticks = MaxNLocator(most, steps=[1, 2, 5, 10], integer=True).tick_values(low, high)
        found.set_ticks([each for each in ticks if low <= each <= high])
    if axis.get("showticklabels") is False:
        getattr(ax, f"set_{which}ticks")([])
    if axis.get("rangemode") == "tozero":
        ax.set(**{f"{which}lim": (min(0.0, found.get_view_interval()[0]), None)})
    if "range" in axis:
        ends = np.asarray(axis["range"], dtype=float)
        ax.set(**{f"{which}lim": 10.0**ends if axis.get("type") == "log" else ends})
