"""Options and data shared by all tests."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


def pytest_addoption(parser):
    parser.addoption(
        "--rewrite-goldens",
        action="store_true",
        help="write golden files and the tables in the FMU READMEs anew instead of comparing with them",
    )


@pytest.fixture(scope="session")
def rewrite_goldens(request):
    return request.config.getoption("--rewrite-goldens")


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """Build the four FMUs of a kind when they are first asked for; paths by name, all in one folder."""
    from gossamer_fmus import build_all

    options = {"python": {}, "native": {"native": True}, "native FMI 3": {"native": True, "fmi": 3}}
    paths = {}

    def get(kind):
        if kind not in paths:
            if kind != "python":
                pytest.importorskip("ziglang", reason="native FMUs need the compiler ziglang")
            paths[kind] = build_all(tmp_path_factory.mktemp(kind.replace(" ", "_")), **options[kind])
        return paths[kind]

    return get
