"""The FMUs of all kinds, built once for all tests: the four, and the compensator that estimates."""

import fmpy
import pytest
from fmu_host import FMUS, Instance, model_of

KINDS = ("python", "native")


@pytest.fixture(scope="session")
def models():
    return {name: model_of(name) for name in FMUS}


@pytest.fixture(scope="session")
def built(built, tmp_path_factory):
    """Build the estimator beside the four."""
    from gossamer_fmus import build_all

    options = {"python": {}, "native": {"native": True}, "native FMI 3": {"native": True, "fmi": 3}}
    paths = {}

    def get(kind):
        if kind not in paths:
            four, folder = built(kind), tmp_path_factory.mktemp("estimator")
            made = build_all(folder, ["compensator"], method="estimator", **options[kind])
            paths[kind] = four | {"estimator": made["compensator"]}
        return paths[kind]

    return get


@pytest.fixture(scope="session")
def unzipped_once(tmp_path_factory):
    folders = {}

    def get(path):
        if path not in folders:
            folders[path] = fmpy.extract(path, str(tmp_path_factory.mktemp(path.stem)))
        return folders[path]

    return get


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def fmus(built, kind):
    """FMUs of the kind by name."""
    return built(kind)


@pytest.fixture
def unzipped(fmus, unzipped_once):
    return {name: unzipped_once(path) for name, path in fmus.items()}


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
