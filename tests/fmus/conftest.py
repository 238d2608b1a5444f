"""The FMUs and instances of them, by kind: Python or native."""

import fmpy
import pytest
from fmu_host import FMUS, Instance, model_of

KINDS = ("python", "native")


@pytest.fixture(scope="session")
def models():
    return {name: model_of(name) for name in FMUS}


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
