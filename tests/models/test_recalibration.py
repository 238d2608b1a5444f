"""Sensors that are identified again in flight, from the strain of a twin that explains the record."""

from dataclasses import replace

import numpy as np
import pytest
from gossamer_models import DataError, Stepper, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import default_artifact
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin, recalibrate
from gossamer_models.twin.simulation import SensorBank

STEP, STEPS = 3e-4, 1000
STRUCTURE = square_structure(4, 1)  # twin and truth have the same mesh, so that a simulation costs little
LATER = {"pressure_amplitude": np.array([0.8e4]), "pressure_frequency": np.array([9.5])}
DAMAGE = 0.3 * np.eye(16)[5:6] + 0.15 * np.eye(16)[10:11]


def bent(size, at):
    """A sensor whose tables are larger by smooth shares, most about some strain, and whose creep is another."""
    artifact = default_artifact()
    x = (np.arange(artifact.n_lines) + 0.5) / artifact.n_lines
    share = 1.0 + size * np.exp(-0.5 * (((x - at) / 0.2) ** 2 + (x[:, None] / 0.4) ** 2))
    mu, nu = (tuple(map(tuple, (share * table).tolist())) for table in artifact.tables())
    relaxation = tuple(replace(term, amplitude=(1.0 + size) * term.amplitude) for term in artifact.relaxation)
    return replace(artifact, mu=mu, nu=nu, relaxation=relaxation, scales=None)


TRUE = [bent(0.25, 0.1), bent(-0.1, 0.2), bent(0.4, 0.15), bent(0.0, 0.0)]


@pytest.fixture(scope="module")
def twin():
    return Twin(STRUCTURE, sensor=default_artifact())


@pytest.fixture(scope="module")
def flown(twin):
    """Strain and resistance of a flight, and of a later one under another load; noise of 0.1 % of the range."""
    flights, parameters = [], twin.bank.parameters
    for given in ({}, LATER):
        strain = MembraneForward(STRUCTURE).strain(DAMAGE, given, {}, STEPS, STEP)[0]
        banks = [SensorBank(a, 1, 0.0, {n: v[k] for n, v in parameters.items()}) for k, a in enumerate(TRUE)]
        flights.append((strain, np.concatenate([b.read(strain[None, k : k + 1], STEP)[0][0] for k, b in enumerate(banks)])))
    noise = 1e-3 * float(np.ptp(flights[0][1], axis=1).mean())
    values = flights[0][1] + noise * np.random.default_rng(1).standard_normal((4, STEPS))
    return flights, ResponseRecord(step=STEP, values=values, kind="resistance", noise=noise)


@pytest.fixture(scope="module")
def answer(twin, flown):
    return twin.fit(flown[1])


def recovered(artifact, parameters, resistance):
    model = Stepper(compensator_model(artifact, "inverse"), **parameters)
    model.initialize()
    return simulate(model, np.full(STEPS, STEP), {"resistance": resistance}, ["strain"])["strain"]


def test_a_later_flight_is_recovered_to_a_few_tenths_of_a_percent(twin, flown, answer):
    """The issue asks 0.4 % of the range; the deviation that is stated is that of the error, within a factor of 2.5."""
    (strain, _), (later, resistance) = flown[0]
    assert answer.valid
    assert np.abs(answer.damage - DAMAGE[0]).max() < 0.01
    assert (np.sqrt(np.mean((answer.strain - strain) ** 2, axis=1)) < 1e-3 * np.ptp(strain, axis=1)).all()
    found = recalibrate(answer, twin.bank, "flight.csv")
    assert list(found) == [1, 2, 3, 4]
    for k, each in found.items():
        rest = {"rest_strain": float(twin.bank.parameters["rest_strain"][k - 1])}
        old = rest | {
            name: float(twin.bank.parameters[name][k - 1])
            for name in ("full_scale_strain", "full_scale_resistance_change", "rest_resistance")
        }
        before, after = (
            100.0 * float(np.std(strain - later[k - 1])) / float(np.ptp(later[k - 1]))
            for strain in (
                recovered(replace(default_artifact(), scales=None), old, resistance[k - 1]),
                recovered(each.artifact, rest, resistance[k - 1]),
            )
        )
        assert after < 0.4
        assert k == 4 or before > 1.5
        assert after < 2.5 * 100.0 * each.deviation / np.ptp(later[k - 1])
        assert each.after < 1.5e-3
        assert each.artifact.compensator == "inverse"
        assert "flight.csv" in each.artifact.provenance["identified again"]


def test_beyond_the_strain_of_the_record_the_tables_are_the_old_ones(twin, answer):
    found = recalibrate(answer, twin.bank)
    for k, each in found.items():
        beyond = int(np.ceil(each.strain[1] / twin.bank.parameters["full_scale_strain"][k - 1] * len(each.artifact.mu)))
        assert each.covered < 0.6
        far = beyond + 8  # fields reach over some cells
        np.testing.assert_allclose(np.array(each.artifact.mu)[:, far:], np.array(default_artifact().mu)[:, far:], atol=1e-12)


def test_a_twin_that_does_not_explain_the_record_is_no_reference(twin, answer):
    with pytest.raises(DataError, match="its strain is no reference"):
        recalibrate(replace(answer, valid=False), twin.bank)
