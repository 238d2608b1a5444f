"""The root of all errors, and that of data; they import nothing, for FMUs in Python carry them."""


class GossamerError(Exception):
    """Root of every error that this project raises on purpose."""


class DataError(GossamerError, ValueError):
    """Measured or tabulated data that cannot be used as they are."""
