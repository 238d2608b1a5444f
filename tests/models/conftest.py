"""A record of the sensor that ships with the package, and a quick fit of it."""

import pytest
from gossamer_models.sensor import sensor_model
from gossamer_models.sensor.fit import fit_preisach
from oracles.preisach import drive, start
from oracles.records import QUICK, everything, record, zigzag


@pytest.fixture(scope="session")
def known():
    """A record made by the sensor that ships with the package, in ohm."""
    strain = zigzag()
    return record(strain, 100.0 + 50.0 * drive(start(sensor_model()), strain, 0.1))


@pytest.fixture(scope="session")
def fitted(known):
    return fit_preisach((known,), everything(known), QUICK, full_scale=1.0, rest_resistance=100.0)


@pytest.fixture
def dashes(monkeypatch):
    """Sentences name options as the command line does."""
    monkeypatch.setenv("GOSSAMER_OPTIONS", "dashes")
