"""Pictures and tables of an identified sensor: densities, Everett surfaces, relaxation, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from gossamer_models.fitting.errors import Parameter
from gossamer_models.fractional import FractionalArtifact, FractionalFit
from gossamer_models.sensor import RelaxationTerm, SensorArtifact
from gossamer_models.sensor.fit import PreisachFit
from gossamer_models.sensor.fit.doubts import parameters
from gossamer_models.sensor.plots import constant_eta, everett, preisach_plane
from gossamer_orchestrator.pages import Chart, folded, heat, points, table
from gossamer_orchestrator.pages.charts import Trace

SECTION = "The identified sensor"
FLAT = 0.01  # [1] difference of the Everett surfaces over their range that needs no picture
FEW = 8  # relaxation terms that need no folding


def sensor_charts(artifact: SensorArtifact) -> list[Chart]:
    """Return the pictures of a Preisach sensor."""
    return [*_planes(artifact), *_everett(artifact), *_relaxation(artifact)]


def sensor_tables(fit: PreisachFit | FractionalFit) -> str:
    """Return the relaxation terms and the fitted parameters as tables in HTML."""
    if isinstance(fit, FractionalFit):
        return table((), _fractional(fit.artifact), "The sensor") + _parameters(fit.parameters)
    known, _ = parameters(fit)
    return (
        table((), _preisach(fit), "The sensor")
        + _terms(fit.artifact.relaxation)
        + folded(f"{len(known)} fitted parameters", _parameters(known))
    )


def _planes(artifact: SensorArtifact) -> list[Chart]:
    """Return mu over the Preisach plane, and eta unless it is the same everywhere."""
    cells = (np.arange(artifact.n_lines) + 0.5) / artifact.n_lines
    mu, eta = (preisach_plane(artifact, name) for name in ("mu", "eta"))
    off_line = mu[np.tril_indices(artifact.n_lines, -1)]
    top = float(off_line.max()) or float(np.nanmax(mu))
    constant = constant_eta(artifact)
    same = (
        "" if constant is None else f" eta, the share of mu that a down-switch removes, is {constant:.4g} everywhere."
    )
    charts = [
        _map(
            "Density mu",
            heat(cells, cells, mu, "mu [1]", zmin=0.0, zmax=top),
            note=f"The elastic line, the diagonal, reaches {np.diag(mu).max():.3g} and may exceed the scale.{same}",
            text=f"Weights of up-switching over the Preisach plane, up to {top:.3g} off the elastic line.{same}",
        )
    ]
    if constant is None:
        lowest, highest = float(np.nanmin(eta)), float(np.nanmax(eta))
        charts.append(
            _map(
                "Share eta",
                heat(cells, cells, eta, "eta [1]", zmin=min(lowest, 0.9), zmax=max(highest, 1.1)),
                note="The share of mu that a down-switch removes.",
                text=f"eta over the Preisach plane, from {lowest:.3g} to {highest:.3g}.",
            )
        )
    return charts


def _everett(artifact: SensorArtifact) -> list[Chart]:
    """Return the Everett surface of rising strain, and what the one of falling strain differs by if it does."""
    rise, fall = everett(artifact)
    levels = np.linspace(0.0, 1.0, artifact.n_lines + 1)
    top = float(np.nanmax(rise))
    left = rise - fall
    charts = [
        _map(
            "Everett surface",
            heat(levels, levels, rise, "rise [1]"),
            note="Rise of the output when strain rises from beta to alpha, without relaxation.",
            text=f"The output rises by {top:.3g} from no strain to full scale.",
        )
    ]
    if np.nanmax(np.abs(left)) > FLAT * top:
        charts.append(
            _map(
                "What a cycle leaves",
                heat(levels, levels, left, "left [1]"),
                note="Rise of the output when strain rises from beta to alpha, less its fall on the way back.",
                text=f"A cycle leaves at most {np.nanmax(left):.3g} and at least {np.nanmin(left):.3g} of the output.",
            )
        )
    return charts


def _map(title: str, trace: Trace, note: str, text: str) -> Chart:
    """Return a picture over the plane of switching strains, over full scale."""
    x, y = "beta, strain of down-switching [1]", "alpha, strain of up-switching [1]"
    return Chart(section=SECTION, title=title, x=x, y=y, traces=[trace], note=note, text=text)


def _relaxation(artifact: SensorArtifact) -> list[Chart]:
    """Return amplitudes over times of the relaxation terms, by what drives them; one term stands in the table alone."""
    if len(artifact.relaxation) < 2:
        return []
    traces, said = [], []
    for k, name in enumerate(dict.fromkeys(map(_driven, artifact.relaxation))):
        here = [term for term in artifact.relaxation if _driven(term) == name]
        times, sizes = [_time(term) for term in here], [term.amplitude for term in here]
        traces.append(points(name, np.array(times), np.array(sizes), f"@{k}", size=9))
        said.append(f"{name}: amplitudes {min(sizes):.3g} to {max(sizes):.3g}.")
    return [
        Chart(
            section=SECTION,
            title="Relaxation",
            note="Terms A exp(-(t / tau)^c) by what excites them.",
            text=" ".join(said),
            x="time tau [s]",
            y="amplitude A [1]",
            traces=traces,
            layout={"xaxis": {"type": "log"}, "showlegend": True},
        )
    ]


def _driven(term: RelaxationTerm) -> str:
    drive = term.excitation
    what = f"{drive.strain} strain" + (" times strain" if drive.power else "")
    return f"{what}, a gain" if drive.gain else what


def _time(term: RelaxationTerm) -> float:
    """Return the time of a term, of exp(-b t^c) = exp(-(t / tau)^c) [s]."""
    return float(term.rate ** (-1.0 / term.exponent))


def _terms(relaxation: Sequence[RelaxationTerm]) -> str:
    if not relaxation:
        return "<p>The sensor has no relaxation.</p>"
    head = ("driven by", "amplitude A [1]", "time tau [s]", "exponent c [1]", "exponentials")
    rows = [
        (_driven(each), f"{each.amplitude:.4g}", f"{_time(each):.4g}", f"{each.exponent:.4g}", len(each.decay_rates))
        for each in relaxation
    ]
    inner = table(head, rows, "Relaxation, terms A exp(-(t / tau)^c)", row_heads=False)
    return folded(f"{len(rows)} relaxation terms", inner) if len(rows) > FEW else inner


def _parameters(known: Sequence[Parameter]) -> str:
    head = ("parameter", "value", "standard deviation", "determined by the data")
    rows = [
        (
            p.name,
            f"{p.value:.5g}",
            f"{p.deviation:.2g}" if isfinite(p.deviation) else "-",
            "yes" if p.determined else "no",
        )
        for p in known
    ]
    return table(head, rows, "Fitted parameters")


def _preisach(fit: PreisachFit) -> list[tuple[str, str]]:
    """Return what the sensor consists of."""
    artifact = fit.artifact
    return [
        ("Model", f"modified Preisach, {fit.settings.density}, {artifact.n_lines} lines"),
        (
            "Full scale",
            f"{100.0 * fit.full_scale:.4g} % strain, where the output has risen by {fit.resistance_change:.5g}",
        ),
        ("At rest", f"{fit.rest_resistance:.6g}"),
        (
            "Compensator",
            f"{artifact.compensator or 'inverse'}{', a direct inverse beside it' * bool(artifact.inverse)}",
        ),
        ("Network that corrects the output", "none" if artifact.residual is None else "yes"),
        (
            "White noise of the output",
            "not measured" if artifact.noise is None else f"{artifact.noise:.3g} of its range",
        ),
    ]


def _fractional(artifact: FractionalArtifact) -> list[tuple[str, str]]:
    return [
        ("Model", f"fractional-{artifact.model}, {len(artifact.terms)} terms, {len(artifact.fading)} fading"),
        ("Full scale", f"{100.0 * artifact.full_scale_strain:.4g} % strain"),
        ("Change at an output of one", f"{artifact.resistance_change:.5g}"),
        ("At rest", f"{artifact.rest_resistance:.6g}"),
        ("Memory", f"{artifact.shortest:.4g} to {artifact.longest:.4g} s"),
        ("Compensator", "none: a fractional model has no inverse"),
    ]
