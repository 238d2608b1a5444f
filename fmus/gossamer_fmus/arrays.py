"""Arrays of a model's table: neighbouring variables that share a name, such as ``strain[1]`` .. ``strain[4]``."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from itertools import groupby, product

from gossamer_models import ParameterError, StepModel, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class Array:
    """One array, or one scalar.

    Attributes
    ----------
    name : str
        Without indices.
    first : int
        Place of the first element in the table.
    members : tuple of Variable
        Elements; the last index runs fastest.
    shape : tuple of int
        Empty for a scalar.
    """

    name: str
    first: int
    members: tuple[Variable, ...]
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of elements."""
        return len(self.members)

    @property
    def label(self) -> str:
        """Name with the first and last indices."""
        names = [f"`{v.name}`" for v in self.members]
        return names[0] if len(names) == 1 else f"{names[0]} .. `{self.members[-1].name}`"

    @property
    def description(self) -> str:
        """Common beginning of the descriptions of all elements."""
        if self.size == 1:
            return self.members[0].description
        common = os.path.commonprefix([v.description for v in self.members])  # noqa: RUF071
        return re.sub(r"[^\w)]+$", "", common[: common.rfind(" ")]) + " .."


def arrays_of(model: StepModel) -> list[Array]:
    """Return the arrays and scalars of a model in table order.

    Raises
    ------
    ParameterError
        Elements are missing, are not in the order in which the last index runs fastest, or differ in unit, range or
        variability.
    """
    arrays: list[Array] = []
    numbered = enumerate(model.variables)
    for (name, _), group in groupby(numbered, key=lambda item: (item[1].name.split("[")[0], item[1].causality)):
        places, members = zip(*group, strict=True)
        last = re.search(r"\[(.*)\]", members[-1].name)
        shape = tuple(int(part) for part in last[1].split(",")) if last else ()
        indices = product(*(range(1, size + 1) for size in shape))
        names = [f"{name}[{','.join(map(str, index))}]" if index else name for index in indices]
        kinds = {(v.unit, v.minimum, v.maximum, v.nominal, v.discrete) for v in members}
        if [v.name for v in members] != names or len(kinds) > 1 or name in {array.name for array in arrays}:
            msg = (
                f"the elements of {name!r} in model {model.name!r} do not form an array: list all of them in one place, the "
                "last index fastest, with one unit, range and variability."
            )
            raise ParameterError(msg)
        arrays.append(Array(name=name, first=places[0], members=members, shape=shape))
    return arrays
