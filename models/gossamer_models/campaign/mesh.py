"""The membrane of a campaign: the square or a setup, with what is constant and what acts over time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from pathlib import Path

from ..membrane import Setup, Structure, as_built, make_structure, read_mesh, read_structure, square_structure, surface_mesh
from ..membrane.surface import refined
from ..mistakes import DescriptionError, Mistake, raise_any
from ..twin.nuisances import LoadTable
from ..variables import Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Membrane of a campaign.

    Attributes
    ----------
    elements_per_side, order, law
        Of the square, as in ``square_structure``; they have no meaning beside a setup.
    setup : Setup or None
        Another membrane than the square; its ``mesh`` is the path of a file.
    carried : str
        The structure that the setup was read from, as ``structure_text`` wrote it; its mesh takes the place of the file.
    parameters : mapping of str to float
        Parameters and constant inputs by name; the others keep their start values.
    load : LoadTable or None
        Inputs over time: a case begins at rest under the first of them.
    finer : float
        Share of the chunks whose cases run on finer elements, see ``Structure.finer`` [1]; they are spread evenly.
    """

    elements_per_side: int = 4
    order: int = 4
    law: str = "st_venant_kirchhoff"
    setup: Setup | None = None
    carried: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    load: LoadTable | None = None
    finer: float = 0.0

    def __post_init__(self) -> None:
        given = [row.name for row in fields(self)[:3] if getattr(self, row.name) != row.default]
        if self.setup is not None and given:
            text = f"{given[0]!r} is of the square membrane, and the setup says its own. Remove one of them."
            raise DescriptionError(Mistake((given[0],), text))
        _ = self.structure
        if not 0.0 <= self.finer <= 1.0:
            raise DescriptionError(
                Mistake(("finer",), f"'finer' is {self.finer:g}. Write a share of the cases from 0 to 1.")
            )
        mistakes = [m for name, value in self.parameters.items() for m in self.outside(("parameters", name), value)]
        if self.load is not None and self.load.states:
            mistakes.append(Mistake(("load",), "these are states of rest, and a case is a history. Write a column of time."))
        both = "stands in the table of loads and is a constant, too. Remove one of them."
        twice = [Mistake(("parameters", name), f"{name!r} {both}") for name in self.parameters if name in self.histories]
        raise_any(mistakes + twice)

    def of_order(self, order: int) -> Mesh:
        """Return the membrane with elements of another order, and no other cases beside."""
        if self.setup is None:
            return replace(self, order=order, finer=0.0)
        return replace(self, setup=replace(self.setup, order=order), finer=0.0)

    def is_finer(self, chunk: int) -> bool:
        """Tell whether a chunk, from 0, runs on finer elements."""
        return int((chunk + 1) * self.finer + 1e-9) > int(chunk * self.finer + 1e-9)

    @property
    def histories(self) -> tuple[str, ...]:
        """Inputs that change over time."""
        return () if self.load is None else tuple(self.load.values)

    @property
    def structure(self) -> Structure:
        """The membrane, with its zones and sensors."""
        if self.setup is None:
            return _square(self.elements_per_side, self.order, self.law)
        return _on_its_mesh(self.setup, self.carried)

    @property
    def settable(self) -> dict[str, Variable]:
        """Parameters and inputs that a campaign can hold or vary, by name: all but the damage."""
        return _settable(self.structure)

    def base(self, name: str) -> float:
        """Return the constant value of a quantity."""
        return float(self.parameters.get(name, self.settable[name].start or 0.0))

    def outside(self, place: tuple[str, ...], value: float) -> Iterator[Mistake]:
        """Refuse an unknown variable of the membrane, the last part of a place, or a value out of its range."""
        name, known = place[-1], self.settable
        if name not in known:
            yield Mistake(place, f"the membrane has no {name!r}.", name, tuple(known))
            return
        row = known[name]
        low, high = (end if limit is None else limit for limit, end in ((row.minimum, -math.inf), (row.maximum, math.inf)))
        if not low <= value <= high:
            text = f"{name!r} reaches {value:g}; the membrane takes {low:g} to {high:g} {row.unit}. Correct it."
            yield Mistake(place, text)


_square = lru_cache(maxsize=8)(square_structure)


@lru_cache(maxsize=8)
def _on_its_mesh(setup: Setup, carried: str) -> Structure:
    if carried:
        there = read_structure(carried)
        same = there.setup.order == setup.order
        return make_structure(setup, there.mesh if same else refined(there.mesh, setup.order, quarters=False))
    mesh = surface_mesh(read_mesh(Path(setup.mesh), setup.scale), setup.order)
    return make_structure(setup, mesh if setup.built is None else as_built(mesh, setup.built))


@lru_cache(maxsize=8)
def _settable(structure: Structure) -> dict[str, Variable]:
    rows = [v for v in structure.table if v.causality in ("parameter", "input") and not v.name.startswith("damage[")]
    return {row.name: row for row in rows}
