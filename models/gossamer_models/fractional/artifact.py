r"""Identified numbers of one fractional model and their provenance.

Symbols: ``s`` strain over its full scale [1], :math:`C_0, C_k` coefficients [1], [s**a] or [s**-a], :math:`a_k`
orders [1], :math:`b_k` phases [1], :math:`C_l` coefficients [1/s], :math:`p_l` rates [1/s], :math:`q_l` exponents
[1]. All models of Chapter 3 of the thesis, Eqs. (3.15), (3.21) and (3.25), are

.. math:: R - R_0 = \Delta R \left[C_0 s + \sum_k C_k\,O^{a_k} s_{b_k}
          + \sum_l C_l \int_0^t e^{-p_l (t-\tau)} s^{q_l}\,d\tau\right], \qquad O = D \text{ or } J,

with :math:`s_b` the strain whose Fourier components are turned by :math:`\pi b/2`, Eq. (3.18).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from ..artifacts import read_as, write_artifact
from ..errors import require
from ..modes import PowerLawKernels, check_order

SCHEMA = "gossamer.fractional"
VERSION = 1
ModelName = Literal["model-1", "sub-model-1", "sub-model-2"]
MODELS: tuple[ModelName, ...] = get_args(ModelName)
PHASES = {"model-1": (-2.0, 0.0), "sub-model-1": (0.0, 0.0), "sub-model-2": (-1.0, 1.0)}  # [1], of b


@dataclass(frozen=True, slots=True, kw_only=True)
class FractionalTerm:
    """One fractional operator on strain.

    Attributes
    ----------
    coefficient : float
        :math:`C_k`, of the unit that makes the term a ratio.
    order : float
        :math:`a_k` [1], 0 < a < 1.
    phase : float
        :math:`b_k` [1]; zero in sub-model-1.
    """

    coefficient: float
    order: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        check_order(self.order)
        require(
            np.isfinite((self.coefficient, self.phase)).all(),
            f"a fractional term has C = {self.coefficient:g} and b = {self.phase:g}. Identify it again.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FadingTerm:
    """One integral of a power of strain that fades, of model-1.

    Attributes
    ----------
    coefficient : float
        :math:`C_l` [1/s].
    rate : float
        :math:`p_l` [1/s], positive.
    exponent : float
        :math:`q_l` [1], positive.
    """

    coefficient: float
    rate: float
    exponent: float

    def __post_init__(self) -> None:
        C, p, q = self.coefficient, self.rate, self.exponent
        require(
            np.isfinite((C, p, q)).all() and p > 0.0 and q > 0.0,
            f"a fading term needs finite numbers, p > 0 and q > 0, not C = {C:g}, p = {p:g}, q = {q:g}",
        )


@dataclass(frozen=True, kw_only=True)
class FractionalArtifact:
    r"""A fractional model of one sensor.

    Attributes
    ----------
    model : {"model-1", "sub-model-1", "sub-model-2"}
        Eq. (3.15), derivatives; Eq. (3.21) and Eq. (3.25), integrals; of the thesis.
    direct : float
        :math:`C_0` [1].
    terms : tuple of FractionalTerm
        Derivatives in model-1, else integrals.
    fading : tuple of FadingTerm
        Of model-1 only.
    full_scale_strain : float
        Unit [1] of the strain of the model.
    resistance_change : float
        :math:`\Delta R` [ohm], the change of resistance at a model output of one.
    rest_resistance : float
        :math:`R_0` [ohm] before the first loading.
    shortest, longest : float
        Range of times [s] of the memory, see ``PowerLawKernels``.
    provenance : dict
        Origin and digest of the data, command, errors reached, assumptions.
    """

    model: ModelName
    direct: float
    terms: tuple[FractionalTerm, ...]
    fading: tuple[FadingTerm, ...] = ()
    full_scale_strain: float
    resistance_change: float
    rest_resistance: float = 0.0
    shortest: float = 1e-4
    longest: float = 1e5
    provenance: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_model(self.model)
        strain, change = self.full_scale_strain, self.resistance_change
        scales = f"{strain:g} for strain, {change:g} ohm for resistance"
        require(strain > 0.0 and change > 0.0, f"the scales must be positive, not {scales}. Identify the model again.")
        require(
            np.isfinite((self.direct, strain, change, self.rest_resistance)).all(),
            "a fractional model holds a number that is not finite. Identify it again.",
        )
        low, high = PHASES[self.model]
        for term in self.terms:
            require(
                low <= term.phase <= high,
                f"a phase of {self.model} is {term.phase:g}; it must lie in {low:g} to {high:g}. Identify it again.",
            )
        require(
            not self.fading or self.model == "model-1",
            f"{self.model} has no fading integrals; only model-1 has. Leave them out.",
        )
        _ = self.kernels  # refuses an empty range of times

    @property
    def kernels(self) -> PowerLawKernels:
        """Kernels and rates of the memory."""
        return PowerLawKernels(self.shortest, self.longest)

    @property
    def can_step(self) -> bool:
        """Whether an FMU can run it: phases need the whole record."""
        return self.model == "sub-model-1"

    def write(self, path: Path) -> None:
        """Write the artifact as JSON."""
        content = asdict(self)
        write_artifact(path, SCHEMA, VERSION, content.pop("provenance"), content)

    @classmethod
    def read(cls, path: Path) -> FractionalArtifact:
        """Read what ``write`` wrote.

        Raises
        ------
        ArtifactError
            The file is missing, truncated, of another schema or version, or its content is not a usable model.
        """
        return read_as(cls, "fractional model", path, SCHEMA, VERSION)


def check_model(name: str) -> None:
    """Refuse the name of a model that does not exist."""
    require(name in MODELS, f"there is no fractional model {name!r}; it is one of {', '.join(MODELS)}")
