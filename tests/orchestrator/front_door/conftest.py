"""Made-up results, as the tests of results have them."""

from ..results.conftest import data

__all__ = ["data"]
