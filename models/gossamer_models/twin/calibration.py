"""The numbers of a structure as its healthy records tell them, with their covariance; ``s`` of them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files import read_json
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import DataError, ParameterError, require
from ..membrane import Structure, make_structure, square_structure
from ..membrane.gauges import moved_gauge
from ..membrane.setup import KnownNumbers
from .forward import Forward
from .nuisances import LASTING, Spread, number_of

SCHEMA, VERSION = "gossamer.calibration", 1
ROWS = ("names", "chi2_per_sample", "chi2_bound", "doubts", "untold")
ARRAYS = ("factors", "covariance", "prior")


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Numbers of a structure, as healthy records tell them.

    Attributes
    ----------
    names : tuple of str
        What was fitted, of ``SCALES``, and gains and places of the sensors.
    factors : ndarray, shape (s,)
        Value of each over that of the setup, gains [1], and how far sensors are off their points [m].
    covariance : ndarray, shape (s, s)
        Of the logarithms of factors, of gains, and of places.
    prior : ndarray, shape (s,)
        Deviations of these beforehand.
    parameters : dict of str to float
        Parameters of the model with these values.
    chi2_per_sample, chi2_bound : tuple of float
        Of each record.
    doubts : tuple of str
        Why it should not be used; none if it may be.
    untold : tuple of str
        Combinations of numbers that the records do not decide, and records whose mesh was not refined, a sentence each.
    drawing : str
        Digest of the drawing: material, supports, edges, gas, cables, beams and masses.
    """

    names: tuple[str, ...]
    factors: Vector
    covariance: Matrix
    prior: Vector
    parameters: dict[str, float]
    chi2_per_sample: tuple[float, ...]
    chi2_bound: tuple[float, ...]
    doubts: tuple[str, ...] = ()
    untold: tuple[str, ...] = ()
    drawing: str = ""

    @property
    def valid(self) -> bool:
        """Whether it may be used."""
        return not self.doubts

    @property
    def deviation(self) -> Vector:
        """Standard deviation of each factor [1], and place [m], shape (s,)."""
        return np.asarray(np.where(_are(LASTING, self.names), 1.0, self.factors) * np.sqrt(np.diag(self.covariance)))

    @property
    def spread(self) -> Spread:
        """How well the factors are known."""
        return _spread(self.known)

    @property
    def of_structure(self) -> Calibration:
        """The same without gains and places, of what simulates the structure."""
        at = np.flatnonzero(~_are(LASTING, self.names))
        return replace(
            self,
            names=tuple(self.names[k] for k in at),
            factors=self.factors[at],
            covariance=self.covariance[np.ix_(at, at)],
            prior=self.prior[at],
        )

    @property
    def known(self) -> KnownNumbers:
        """What a setup carries of it."""
        covariance = tuple(map(tuple, self.covariance.tolist()))
        gains, *places = (tuple(self.factors[_are((kind,), self.names)].tolist()) for kind in LASTING)
        return KnownNumbers(
            names=self.names,
            covariance=covariance,
            parameters=self.parameters,
            gains=gains,
            places=tuple(zip(*places, strict=True)),
            drawing=self.drawing,
        )

    def applied(
        self, structure: Structure | Forward | None, parameters: Mapping[str, float] | None
    ) -> tuple[Structure, dict[str, float]]:
        """Return a structure whose calibrated numbers are parameters, and these with what is given beside.

        Raises
        ------
        ParameterError
            It is no membrane of a setup, or one that was drawn otherwise, or the calibration is not valid.
        """
        if not (structure is None or isinstance(structure, Structure)):
            msg = "a calibration is of the membrane of a setup. Give that, not another forward model."
            raise ParameterError(msg)
        require(self.valid, f"the calibration is not valid: {'; '.join(self.doubts)}. Calibrate again.")
        structure = structure or square_structure()
        known = self.known
        _check_drawing(known, structure)
        structure = with_factors(structure, self.names)
        if known.places:
            setup, mesh = replace(structure.setup, calibration=known), structure.mesh
            moves = zip(setup.sensors, known.places, strict=True)
            gauges = tuple(moved_gauge(mesh, structure.normals, sensor, move) for sensor, move in moves)
            structure = replace(structure, setup=setup, gauges=gauges)
        return structure, {**self.parameters, **(parameters or {})}

    def as_json(self) -> dict[str, Any]:
        """Return it as a document."""
        content = {name: getattr(self, name) for name in (*ROWS, "parameters", "drawing", "valid")}
        return {"schema": SCHEMA, "version": VERSION, **content, **{name: getattr(self, name).tolist() for name in ARRAYS}}

    @classmethod
    def read(cls, path: Path) -> Calibration:
        """Read what ``gossamer calibrate`` wrote.

        Raises
        ------
        DataError
            The file is none.
        """
        try:
            content = read_json(path)
            require((content["schema"], content["version"]) == (SCHEMA, VERSION), "another schema or version", DataError)
            arrays: dict[str, Any] = {name: np.array(content[name], dtype=float) for name in ARRAYS}
            rows: dict[str, Any] = {name: tuple(content[name]) for name in ROWS}
            s = len(rows["names"])
            shapes = {name: array.shape for name, array in arrays.items()}
            require(shapes == {"factors": (s,), "covariance": (s, s), "prior": (s,)}, "arrays of other shapes", DataError)
            return cls(parameters=dict(content["parameters"]), drawing=content["drawing"], **arrays, **rows)
        except (OSError, KeyError, TypeError, ValueError, DataError) as error:
            msg = f"{path} is no calibration: {error}. Make one with 'gossamer calibrate'."
            raise DataError(msg) from error


def spread_of(structure: Structure | Forward | None) -> Spread | None:
    """Return how well the numbers of a structure are known together, if its setup carries a calibration.

    Raises
    ------
    ParameterError
        The calibration is of a structure that was drawn otherwise.
    """
    known = structure.setup.calibration if isinstance(structure, Structure) else None
    if known is None or not isinstance(structure, Structure):
        return None
    _check_drawing(known, structure)
    return _spread(known)


def _spread(known: KnownNumbers) -> Spread:
    return Spread(known.names, np.array(known.covariance), known.gains)


def _are(kinds: Sequence[str], names: Sequence[str]) -> NDArray[np.bool_]:
    return np.array([number_of(name) in kinds for name in names], dtype=bool)


def _check_drawing(known: KnownNumbers, structure: Structure) -> None:
    text = "the calibration is of a structure that was drawn otherwise, in its material, supports, edges or gas"
    require(known.drawing in ("", drawing_of(structure)), f"{text}. Calibrate this one.")
    for what, each in (("gains", known.gains), ("places", known.places)):
        text = f"the calibration has {what} of {len(each)} sensors, and the structure has {structure.n_sensors}"
        require(len(each) in (0, structure.n_sensors), f"{text}. Calibrate this one.")


def drawing_of(structure: Structure) -> str:
    """Return a digest of what a structure is drawn of, whatever its mesh and its sensors are."""
    setup = structure.setup
    more = [each for each in (setup.built, setup.cables, setup.beams, setup.masses) if each]
    drawn = (setup.regions, setup.supports, setup.edges, setup.gas, *more)
    return hashlib.sha256(repr(drawn).encode()).hexdigest()[:16]


def with_factors(structure: Structure, names: Sequence[str]) -> Structure:
    """Return a structure whose numbers of some names are parameters; the square has its own."""
    setup = structure.setup
    wanted = tuple(name for name in setup.scalable if name in (*names, *setup.factors))
    if structure.starts_in_plane or wanted == setup.factors:
        return structure
    fine = replace(setup, factors=wanted, refine=0)  # the mesh is as fine as it is
    kept = {name: getattr(structure, name) for name in ("unit_forces", "variables", "probes")}  # as a finer mesh has them
    return replace(make_structure(fine, structure.mesh), setup=replace(fine, refine=setup.refine), **kept)
