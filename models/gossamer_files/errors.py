"""The root of all errors, those of data, and exit codes; they import nothing, for FMUs in Python carry them."""


class GossamerError(Exception):
    """Root of every error that this project raises on purpose."""


class DataError(GossamerError, ValueError):
    """Measured or tabulated data that cannot be used as they are."""


class NotFiniteError(DataError):
    """Data with a number that is not finite, in a file of any kind."""


def exit_code(error: BaseException | None) -> int:
    """Return the exit code of a command that an error ends: 3 where its cause is a number that is not finite, else 1."""
    return 1 if error is None else 3 if isinstance(error, NotFiniteError) else exit_code(error.__cause__)
