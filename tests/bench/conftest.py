"""``make bench`` measures and prints (``--measure``); ``make test`` runs every bench once in a short form, lest one rots."""

import time

import pytest


@pytest.fixture(scope="session")
def measured(request):
    """Whether figures are asked for; else a bench does as little as shows that it still runs."""
    return request.config.getoption("--measure")


@pytest.fixture(scope="session")
def cost(measured):
    """Time one call [us of CPU]: the least over many batches, since the machine may be busy otherwise."""

    def of(call, *arguments, repeats=500, batches=40):
        repeats, batches = (repeats, batches) if measured else (1, 1)
        best = float("inf")
        for _ in range(batches):
            begin = time.process_time()
            for _ in range(repeats):
                call(*arguments)
            best = min(best, (time.process_time() - begin) / repeats)
        return 1e6 * best

    return of
