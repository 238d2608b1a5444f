"""Compensator: resistance back to strain, as an inverse of the sensor, an estimator or a filter that runs the sensor."""

from typing import Literal

from ..errors import ParameterError
from ..sensor.artifact import METHODS, SensorArtifact, default_artifact
from ..step_model import StepModel
from .ageing import with_ageing
from .estimator import estimator_model
from .inverse import direct_model, exact_model
from .particle import filter_model

EXACT = "exact"  # the exact inverse of a sensor that has a direct one too

__all__ = ["compensator_model", "estimator_model", "filter_model"]


def compensator_model(
    artifact: SensorArtifact | None = None,
    method: Literal["inverse", "exact", "estimator", "filter"] | None = None,
    *,
    ageing: bool = False,
) -> StepModel:
    """Build the compensator of the sensor with the same artifact.

    Parameters
    ----------
    artifact : SensorArtifact or None
        Identified sensor; None for the one that ships with the package.
    method : {"inverse", "exact", "estimator", "filter"} or None
        The inverse, for resistance without noise: ``direct_model`` if the artifact has a direct inverse, else
        ``exact_model``; "exact" is this one in any case. ``estimator_model``, which tolerates noise, delays the strain
        and reports its uncertainty. Or ``filter_model``, which does so for every sensor. None for the one that the
        artifact names, else the inverse.
    ageing : bool
        Whether it follows slow gain and offset of the sensor wherever the strain is known, see ``with_ageing``.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1]; estimator and filter have more of both.

    Raises
    ------
    ParameterError
        The method is unknown or cannot compensate this sensor.
    """
    artifact = default_artifact() if artifact is None else artifact
    if ageing:
        return with_ageing(compensator_model(artifact, method), artifact)
    method = method or artifact.compensator or "inverse"  # type: ignore[assignment]
    if method == "estimator":
        return estimator_model(artifact)
    if method == "filter":
        return filter_model(artifact)
    if method not in ("inverse", EXACT):
        msg = f"there is no compensation method {method!r}. Choose one of {', '.join((*METHODS, EXACT))}."
        raise ParameterError(msg)
    return exact_model(artifact) if artifact.inverse is None or method == EXACT else direct_model(artifact)
