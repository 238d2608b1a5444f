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
