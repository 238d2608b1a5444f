"""The sensor that ships with the package: made from measured data by the command it states, as good as it states."""

import shlex
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gossamer_models import Stepper
from gossamer_models.fitting import Columns, Record, read_record
from gossamer_models.identify import settings_for
from gossamer_models.sensor import SensorArtifact, default_artifact, sensor_model
from gossamer_models.sensor.fit import fit_preisach

DATA = Path(__file__).resolve().parents[4] / "shared" / "data" / "nylon_silver"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"measured data are not here: {DATA}")
STATED = default_artifact().provenance


def respond(strain, h):
    """Return the output of the default sensor at rest at the first of some normalised strains."""
    sensor = Stepper(sensor_model(), rest_resistance=0.0, full_scale_resistance_change=1.0, full_scale_strain=1.0)
    sensor.set("rest_strain", strain[0])
    sensor.initialize()
    output = []
    for s in strain:
        sensor.set("strain", s)
        sensor.step(h)
        output.append(sensor.get("resistance"))
    return np.array(output)


@needs_data
def test_the_command_it_states_makes_it_again(tmp_path, monkeypatch):
    monkeypatch.chdir(DATA)
    out = tmp_path / STATED["command"].rsplit(" ", 1)[1]
    arguments = [*shlex.split(STATED["command"])[:-1], str(out)]
    monkeypatch.setattr(sys, "argv", arguments)
    result = invoke(arguments[1:])
    assert result.exit_code == 0, result.output
    again, shipped = SensorArtifact.read(out), default_artifact()
    for found, wanted in zip(again.tables(), shipped.tables(), strict=True):
        assert found == pytest.approx(wanted, rel=1e-5, abs=1e-7)
    assert len(again.relaxation) == len(shipped.relaxation)
    for found, wanted in zip(again.relaxation, shipped.relaxation, strict=True):
        assert (found.power, found.exponent) == (wanted.power, wanted.exponent)
        assert (found.amplitude, found.rate) == pytest.approx((wanted.amplitude, wanted.rate), rel=1e-4)
    numbers = {"scale", "offset"}
    assert {k: v for k, v in again.provenance.items() if k not in numbers} == {
        k: v for k, v in STATED.items() if k not in numbers
    }
    assert float(again.provenance["scale"]) == pytest.approx(float(STATED["scale"]), rel=1e-6)


@needs_data
def test_run_on_the_data_it_has_the_errors_it_states():
    record = read_record(DATA / STATED["data"], Columns(strain="output", resistance="input", sampling_step=0.1))
    y = respond(record.strain / float(STATED["full_scale_strain"]), 0.1)
    error = float(STATED["offset"]) + float(STATED["scale"]) * y - record.resistance
    half, found = record.time.size // 2, {}
    for stretch, part in (("train", error[:half]), ("test", error[half:])):
        found[stretch] = 100.0 * np.sqrt(np.mean(part**2)) / np.ptp(record.resistance)
        assert f"NRMSE {found[stretch]:.3f} %" in STATED[f"{record.name} {stretch}"]
    assert found["train"] < 0.93  # what an earlier fit of the same record reached
    assert found["test"] < 2.08


def test_it_says_where_it_comes_from_and_no_more():
    assert {"data", "origin", "sha256", "command", "settings", "doubts"} <= set(STATED)
    assert "without holds, the data do not separate eta from slow relaxation" in STATED["doubts"]
    assert "0.1 s apart" in STATED["repairs of strain_triangular.csv"]
    assert not any(word.startswith("/") for text in STATED.values() for word in text.split())


def test_its_inverse_neither_amplifies_nor_divides_by_nothing():
    """One eta for all operators; smooth weights, all positive; relaxation that shows."""
    mu, nu = default_artifact().tables()
    cells = np.triu_indices(mu.shape[0])
    assert np.ptp(nu[cells] / mu[cells]) < 1e-9
    assert 0.99 < nu[0, 0] / mu[0, 0] < 1.0
    assert mu[cells].min() > 0.0
    assert mu[0].min() > 0.02
    steps = (np.diff(mu[i, i:]) for i in range(1, mu.shape[0] - 1))
    assert max(np.abs(step).max() for step in steps) < mu[1:].max() / 3.0  # no cell stands out
    (term,) = default_artifact().relaxation
    assert 0.01 < term.amplitude < 0.1
    held = respond(np.concatenate([np.linspace(0.0, 1.0, 20), np.ones(600)]), 0.1)
    assert 3e-3 < held[19] - held[-1] < 0.02


def test_what_made_it_finds_it_again_in_its_own_output_if_nothing_pulls():
    rng = np.random.default_rng(4)
    corners = rng.uniform(0.0, 1.0, 60)
    strain = np.concatenate([[*np.linspace(a, b, 9)[1:], b, b, b] for a, b in pairwise(corners)])
    record = Record(
        name="own output",
        time=np.arange(strain.size, dtype=float),
        strain=strain,
        resistance=3.0 + 2.0 * respond(strain, 1.0),
        lines=np.arange(strain.size),
    )
    settings = settings_for("preisach-hats", knots=6, relaxations=1, tau=(20.0,), exponents=(0.5,), starts=1)
    settings = replace(settings, ridge=1e-6, kernel_stiffness=1e-6, eta_stiffness=1e-4)
    fit = fit_preisach((record,), (np.arange(strain.size) < 400,), settings, full_scale=1.0, rest_resistance=3.0)
    error = (fit.predicted[0] - record.resistance) / np.ptp(record.resistance)
    mu, nu = fit.artifact.tables()
    assert np.sqrt(np.mean(error[:400] ** 2)) < 2e-4
    assert np.sqrt(np.mean(error[400:] ** 2)) < 1e-3
    assert nu.sum() / mu.sum() == pytest.approx(0.9966, abs=5e-4)  # holds tell it from relaxation
    found = {term.power: term.amplitude for term in fit.artifact.relaxation}
    assert found[1] == pytest.approx(default_artifact().relaxation[0].amplitude, rel=0.1)
    assert found.get(0, 0.0) < 1e-4
    assert fit.resistance_change == pytest.approx(2.0, rel=2e-3)
