"""Compensator: resistance back to strain, as the exact inverse of the sensor or as an estimator that tolerates noise."""

from __future__ import annotations

from typing import Literal

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact, default_artifact
from ..step_model import StepModel
from .direct import direct_model
from .estimator import estimator_model
from .exact import exact_model

__all__ = ["compensator_model", "estimator_model"]


def compensator_model(
    artifact: SensorArtifact | None = None, method: Literal["inverse", "estimator"] = "inverse"
) -> StepModel:
    """Build the compensator of the sensor with the same artifact.

    Parameters
    ----------
    artifact : SensorArtifact or None
        Identified sensor; None for the one that ships with the package.
    method : {"inverse", "estimator"}
        The inverse, for resistance without noise: ``direct_model`` if the artifact has a direct inverse, else
        ``exact_model``. Or ``estimator_model``, which tolerates noise, delays the strain and reports its uncertainty.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1]; the estimator has more of both.

    Raises
    ------
    ParameterError
        The method is unknown or cannot compensate this sensor.
    """
    artifact = default_artifact() if artifact is None else artifact
    if method == "estimator":
        return estimator_model(artifact)
    if method != "inverse":
        msg = f"there is no compensation method {method!r}. Choose inverse or estimator."
        raise ParameterError(msg)
    return exact_model(artifact) if artifact.inverse is None else direct_model(artifact)
