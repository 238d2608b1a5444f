"""Charts of a sensor: densities over the Preisach plane, Everett surfaces, relaxation.

A chart that is added to ``sensor_charts`` stands on the page of ``gossamer identify``, and is a file if
``FILES`` names it.
"""

import numpy as np
from gossamer_files.charts import Chart, Trace, heat, points, section

from ..arrays import Matrix
from .artifact import SensorArtifact
from .drives import RelaxationTerm

ETA_SCALE = (0.9, 1.1)  # [1]
SAME_ETA = 0.01  # [1] less is one colour on that scale
FLAT = 0.01  # [1] difference of the Everett surfaces over their range that needs no picture
FILES = {"Density mu": "mu", "Share eta": "eta", "Everett surface": "everett", "What a cycle leaves": "everett_cycle"}


def sensor_charts(artifact: SensorArtifact) -> list[Chart]:
    """Return the charts of a Preisach sensor."""
    planes = [plane_chart(artifact, name) for name in (("mu", "eta") if constant_eta(artifact) is None else ("mu",))]
    return section("The identified sensor", [*planes, *_everett(artifact), *_relaxation(artifact)])


def sensor_files(artifact: SensorArtifact) -> dict[str, Chart]:
    """Return charts by the names of their files."""
    return {FILES[chart.title]: chart for chart in sensor_charts(artifact) if chart.title in FILES}


def preisach_plane(artifact: SensorArtifact, name: str) -> Matrix:
    """Return ``mu`` or ``eta`` over the Preisach plane, shape (N, N).

    The cell of line i and bin k lies in row k, column k - i; not a number above the elastic line, and eta where mu is zero.
    """
    N = artifact.n_lines
    plane = np.full((N, N), np.nan)
    line, k = np.triu_indices(N)
    values = artifact.tables()[0] if name == "mu" else _eta(artifact)
    plane[k, k - line] = values[line, k]
    return plane


def plane_chart(artifact: SensorArtifact, name: str) -> Chart:
    """Return ``mu`` or ``eta`` over the Preisach plane; a constant ``eta`` is named beside ``mu``."""
    cells, plane = (np.arange(artifact.n_lines) + 0.5) / artifact.n_lines, preisach_plane(artifact, name)
    lowest, highest, constant = float(np.nanmin(plane)), float(np.nanmax(plane)), constant_eta(artifact)
    if name == "eta":
        ends = {"zmin": min(lowest, ETA_SCALE[0]), "zmax": max(highest, ETA_SCALE[1])}
        note = "The share of mu that a down-switch removes."
        text = f"eta over the Preisach plane, {lowest:.3g} to {highest:.3g}."
        return _map("Share eta", heat(cells, cells, plane, "eta [1]", **ends), note, text)
    top = float(plane[np.tril_indices(artifact.n_lines, -1)].max(initial=0.0)) or highest
    same = known = ""
    if constant is not None:
        same = f" eta, the share of mu that a down-switch removes, is {constant:.4g} everywhere."
        known = f"eta = {constant:.3g} all over the plane"
    note = f"The elastic line, the diagonal, reaches {np.diag(plane).max():.3g} and may exceed the scale.{same}"
    text = f"Weights of up-switching over the Preisach plane, up to {top:.3g} off the elastic line.{same}"
    return _map("Density mu", heat(cells, cells, plane, "mu [1]", zmin=0.0, zmax=top), note, text, known)


def constant_eta(artifact: SensorArtifact) -> float | None:
    """Return ``eta`` [1] if it is the same all over the plane but for ``SAME_ETA``, else None."""
    eta = _eta(artifact)
    return float(np.nanmean(eta)) if np.nanmax(eta) - np.nanmin(eta) < SAME_ETA else None


def _eta(artifact: SensorArtifact) -> Matrix:
    """Return ``eta`` [1] of each line and bin, shape (N, N); not a number where ``mu`` is zero."""
    mu, nu = artifact.tables()
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mu > 0.0, nu / mu, np.nan)


def everett(artifact: SensorArtifact) -> tuple[Matrix, Matrix]:
    """Return the Everett surfaces of the static operators on the lattice.

    Returns
    -------
    up, down : ndarray, shape (N + 1, N + 1)
        Element [a, b]: rise of the output [1] when strain rises from b/N, at rest or after falling from full scale, to a/N
        >= b/N, and its fall on the way back from a/N to b/N, Eqs. (5.3) and (5.4) of the thesis without
        relaxation; not a number for a < b.
    """
    N = artifact.n_lines
    surfaces = np.full((2, N + 1, N + 1), np.nan)
    line, k = np.triu_indices(N)
    for surface, table in zip(surfaces, artifact.tables(), strict=True):
        square = np.zeros((N, N))
        square[k, k - line] = table[line, k] / N
        for b in range(N + 1):
            grown = square[:, b:].sum(axis=1)
            surface[b:, b] = np.concatenate([[0.0], np.cumsum(grown[b:])])
    return surfaces[0], surfaces[1]


def _everett(artifact: SensorArtifact) -> list[Chart]:
    """Return the Everett surface of rising strain, and what the one of falling strain differs by if it does."""
    rise, fall = everett(artifact)
    levels, top, left = np.linspace(0.0, 1.0, artifact.n_lines + 1), float(np.nanmax(rise)), rise - fall
    note = "Rise of the output when strain rises from beta to alpha, without relaxation."
    text = f"The output rises by {top:.3g} from no strain to full scale."
    charts = [_map("Everett surface", heat(levels, levels, rise, "rise [1]"), note, text)]
    if np.nanmax(np.abs(left)) > FLAT * top:
        note = "Rise of the output when strain rises from beta to alpha, less its fall on the way back."
        text = f"A cycle leaves at most {np.nanmax(left):.3g} and at least {np.nanmin(left):.3g} of the output."
        charts.append(_map("What a cycle leaves", heat(levels, levels, left, "left [1]"), note, text))
    return charts


def _map(title: str, trace: Trace, note: str, text: str, result: str = "") -> Chart:
    """Return a chart over the plane of switching strains, over full scale."""
    x, y = "beta, strain of down-switching [1]", "alpha, strain of up-switching [1]"
    return Chart(title, x, y, [trace], note=note, text=text, result=result)


def _relaxation(artifact: SensorArtifact) -> list[Chart]:
    """Return amplitudes over times of the relaxation terms, by what drives them; one term stands in the table alone."""
    if len(artifact.relaxation) < 2:
        return []
    traces, said = [], []
    for k, name in enumerate(dict.fromkeys(map(driven_by, artifact.relaxation))):
        here = [term for term in artifact.relaxation if driven_by(term) == name]
        times, sizes = np.array([time_of(term) for term in here]), np.array([term.amplitude for term in here])
        traces.append(points(name, times, sizes, f"@{k}", size=9))
        said.append(f"{name}: amplitudes {sizes.min():.3g} to {sizes.max():.3g}.")
    note, layout = "Terms A exp(-(t / tau)^c) by what excites them.", {"xaxis": {"type": "log"}, "showlegend": True}
    return [Chart("Relaxation", "time tau [s]", "amplitude A [1]", traces, note=note, text=" ".join(said), layout=layout)]


def driven_by(term: RelaxationTerm) -> str:
    """Say what excites a relaxation term."""
    drive = term.excitation
    what = f"{drive.strain} strain" + (" times strain" if drive.power else "")
    return f"{what}, a gain" if drive.gain else what


def time_of(term: RelaxationTerm) -> float:
    """Return the time of a term, of exp(-b t^c) = exp(-(t / tau)^c) [s]."""
    return float(term.rate ** (-1.0 / term.exponent))
