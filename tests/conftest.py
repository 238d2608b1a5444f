"""Options and data shared by all tests."""

import os
import shutil
import time
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"
LONG = (  # the longest first, but two that wait for the same FMUs not side by side
    "test_build",
    "test_wheel",
    "test_binaries",
    "test_fuzz",
    "test_sanitizers",
    "test_nothing_is_lost",
    "test_tutorials",
    "test_campaign_run",
    "test_notebooks",
    "test_train_command",
    "test_campaign_cluster",
    "test_membrane_limits",
    "test_membrane_step",
    "test_twin_of_kratos",
)
KINDS = {"python": {}, "native": {"native": True}, "native FMI 3": {"native": True, "fmi": 3}}


def pytest_addoption(parser):
    parser.addoption(
        "--rewrite-goldens",
        action="store_true",
        help="write golden files and the tables in the FMU READMEs anew instead of comparing with them",
    )
    parser.addoption("--measure", action="store_true", help="measure in full what tests/bench runs in a short form")
    parser.addoption(
        "--kills", type=int, help="how often each command is killed, at another moment each time; a few times by default"
    )


def pytest_collection_modifyitems(items):
    """Begin with the files that take longest, so that no worker is left alone with one at the end; mark what kills."""
    for item in items:
        if "kills" in item.fixturenames:
            item.add_marker(pytest.mark.torture)
    items.sort(key=lambda item: LONG.index(item.path.stem) if item.path.stem in LONG else len(LONG))


def pytest_terminal_summary(terminalreporter):
    """Print how often each command was killed or interrupted, and how often that hit a live process."""
    for report in terminalreporter.getreports("passed"):
        for value in (value for name, value in report.user_properties if name == "kills" and report.when == "call"):
            terminalreporter.line(f"{report.nodeid.split('::')[1]}: {value}")


@pytest.fixture(scope="session")
def kills(request):
    """How often each command is killed; None for as often as its test finds enough."""
    return request.config.getoption("--kills")


@pytest.fixture(scope="session")
def rewrite_goldens(request):
    return request.config.getoption("--rewrite-goldens")


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """Fill a folder once per run, whichever worker of pytest-xdist needs it first; the others wait for it.

    ``once(name, fill)`` calls ``fill(folder)`` and returns the folder, which nobody may change after that.
    """
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def get(name, fill):
        folder, claim = base / f"once_{name}", base / f"claim_{name}"
        unfinished, failed = claim / "unfinished", claim / "failed"
        try:
            claim.mkdir()  # one process only succeeds
        except FileExistsError:
            patience = time.monotonic() + 900.0
            while not folder.exists():
                assert not failed.exists(), f"another worker failed to make {name}: see its error"
                assert time.monotonic() < patience, f"another worker has been making {name} for 15 minutes"
                time.sleep(0.1)
            return folder
        unfinished.mkdir()
        try:
            fill(unfinished)
        except BaseException:
            failed.touch()
            raise
        return unfinished.rename(folder)

    return get


@pytest.fixture(scope="session")
def built(once, tmp_path_factory):
    """Return this worker's copy of the FMUs of a kind: paths by name."""
    from gossamer_fmus import build_all

    paths = {}

    def get(kind):
        if kind not in paths:
            if kind != "python":
                pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")

            def build(folder):
                build_all(folder, **KINDS[kind])

            made = once(kind.replace(" ", "_"), build)
            folder = shutil.copytree(made, tmp_path_factory.mktemp("fmus") / made.name)
            paths[kind] = {path.stem: path for path in folder.glob("*.fmu")}
        return paths[kind]

    return get


def built_in_c(once, kind, **options):
    """Folder of the test FMUs of ``tests/fmus/reference``; ``kind`` is the table of their names there."""
    pytest.importorskip("ziglang", reason="the test FMUs need the compiler ziglang")
    from reference import build

    def fill(folder):
        for fmi, names in getattr(build, kind).items():
            for name in names:
                build.build(name, fmi, folder, **options)

    return once(kind, fill)


@pytest.fixture(scope="session")
def reference_fmus(once):
    """Folder of the test FMUs of the behaviour of the FMI project's: ``Stair2.fmu``, ``Stair3.fmu`` and so on."""
    return built_in_c(once, "NAMES")


@pytest.fixture(scope="session")
def exchange_fmus(once):
    """Folder of the same FMUs for model exchange only, those that have such an interface."""
    return built_in_c(once, "EXCHANGED", exchange=True)


@pytest.fixture(scope="session")
def reference_outputs():
    """Folder of the outputs of the FMI project's test FMUs."""
    folder = SHARED / "reference/fmi"
    if not folder.is_dir():
        pytest.skip(f"needs the reference outputs in {folder}")
    return folder
