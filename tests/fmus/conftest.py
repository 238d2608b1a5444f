"""The four FMUs, built once for all tests."""

import fmpy
import pytest
from fmu_host import Instance
from gossamer_fmus import NAMES, build_fmu
from gossamer_fmus.build import MODELS


@pytest.fixture(scope="session")
def models():
    return {name: MODELS[name]() for name in NAMES}


@pytest.fixture(scope="session")
def fmus(models, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    return {name: build_fmu(model, folder) for name, model in models.items()}


@pytest.fixture(scope="session")
def unzipped(fmus, tmp_path_factory):
    folders = {}
    for name, path in fmus.items():
        folders[name] = tmp_path_factory.mktemp(name)
        fmpy.extract(path, str(folders[name]))
    return folders


@pytest.fixture
def instance(fmus, unzipped):
    """Make instances of an FMU by name; all are freed at the end of the test."""
    made = []

    def make(fmu, name="instance"):
        made.append(Instance(fmus[fmu], unzipped[fmu], name))
        return made[-1]

    yield make
    for each in made:
        each.slave.freeInstance()
