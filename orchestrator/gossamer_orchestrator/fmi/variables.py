"""The variables of an FMU as scalars: an array of FMI 3.0 becomes its elements, as FMI 2.0 names them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from attrs import evolve

from ..errors import FmuError
from .types import SAME, TEXTS

MAX_ELEMENTS = 1_000_000


def flatten(
    path: Path, described: Iterable[Any], sizes: Mapping[str, int]
) -> tuple[dict[str, Any], dict[str, list[str]]]:
    """List the scalars and elements of arrays of an FMU.

    Parameters
    ----------
    path : Path
        The FMU, for messages.
    described : iterable of fmpy.model_description.ModelVariable
        Its variables. Their types are renamed to those of ``types``.
    sizes : mapping of str to int
        Values of structural parameters in place of their start values.

    Returns
    -------
    variables : dict of str to fmpy.model_description.ModelVariable
        By name; elements row by row, with one-based indices: ``A[1,1]``, ``A[1,2]``.
    arrays : dict of str to list of str
        The names of the elements of every array.

    Raises
    ------
    FmuError
        An array is absurdly large.
    """
    variables: dict[str, Any] = {}
    arrays: dict[str, list[str]] = {}
    for variable in described:
        variable.type = SAME.get(variable.type, variable.type)
        if not variable.dimensions:
            variables[variable.name] = variable
            continue
        shape = [_size(dimension, sizes) for dimension in variable.dimensions]
        if not 0 <= prod(shape) <= MAX_ELEMENTS:
            msg = (
                f"{path}: its array {variable.name!r} has {' x '.join(map(str, shape))} elements, and at most "
                f"{MAX_ELEMENTS} are exchanged. Give its structural parameters other values."
            )
            raise FmuError(msg)
        starts = _starts(variable, prod(shape))
        names = [f"{variable.name}[{','.join(map(str, i))}]" for i in product(*(range(1, n + 1) for n in shape))]
        arrays[variable.name] = names
        for name, start in zip(names, starts, strict=True):
            variables[name] = evolve(variable, name=name, start=start)
    return variables, arrays


def _size(dimension: Any, sizes: Mapping[str, int]) -> int:  # noqa: ANN401
    if dimension.variable is None:
        return int(dimension.start)
    return sizes.get(dimension.variable.name, int(dimension.variable.start))


def _starts(variable: Any, size: int) -> list[str | None]:  # noqa: ANN401
    """Return the start value of each element; None if the declared ones are of another number."""
    texts: list[Any] = [variable.start] if variable.type in TEXTS else (variable.start or "").split()
    if len(texts) == 1:
        return texts * size
    return texts if len(texts) == size else [None] * size
