"""The FMUs of this project by name: their files and their models."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gossamer_models import ParameterError, StepModel
from gossamer_models.artifacts import artifact_schema
from gossamer_models.compensator import compensator_model
from gossamer_models.detector import PosteriorArtifact, detector_model, posterior_model, read_detector
from gossamer_models.membrane import membrane_model
from gossamer_models.sensor import SensorArtifact, sensor_model

MODELS: dict[str, Callable[..., StepModel]] = {
    "membrane": membrane_model,
    "sensor": sensor_model,
    "compensator": compensator_model,
    "estimator": partial(compensator_model, method="estimator"),  # a compensator that tolerates noise
    "filter": partial(compensator_model, method="filter"),  # a compensator of any sensor
    "detector": posterior_model,
}
NAMES = tuple(MODELS)

_OPTIONS = {
    "artifact": NAMES[1:],
    "elements_per_side": ("membrane",),
    "order": ("membrane",),
}  # and the FMUs that have them
_REFUSALS = {
    "artifact": "FMU {!r} is not built from an artifact. Name those that are: sensor, compensator, estimator, filter or "
    "detector.",
    "elements_per_side": "FMU {!r} has no mesh. Name the membrane alone to choose its elements per side.",
    "order": "FMU {!r} has no mesh. Name the membrane alone to choose the order of its elements.",
}


def fmu_folder(name: str) -> Path:
    """Return the folder with the README and the golden files of an FMU, in a source checkout or an installed package."""
    here = Path(__file__).parent
    return here / name if (here / name).is_dir() else here.parent / name


def package_folder(name: str) -> Path:
    """Return the folder of an installed package without importing it."""
    spec = find_spec(name)
    if spec is None or spec.origin is None:
        msg = f"the package {name!r} is not installed. Install Gossamer with its dependencies."
        raise ModuleNotFoundError(msg)
    return Path(spec.origin).parent


def make_model(name: str, *, compiled: bool = False, **options: Any) -> StepModel:  # noqa: ANN401
    """Make the model of one of the FMUs.

    Parameters
    ----------
    name : str
        One of ``NAMES``.
    compiled : bool
        Whether to use the form of the model for compilation, if it has one.
    **options
        ``artifact``, ``elements_per_side`` and ``order`` as in ``build_all``; None stands for the default.

    Returns
    -------
    StepModel
        The model.

    Raises
    ------
    ParameterError
        The FMU does not have one of the options.
    ArtifactError
        The artifact cannot be used.
    """
    given = {option: value for option, value in options.items() if value is not None}
    for option in given:
        if name not in _OPTIONS[option]:
            raise ParameterError(_REFUSALS[option].format(name))
    artifact = given.pop("artifact", None)
    if name == "membrane":
        return membrane_model(**given, compiled=compiled)
    if artifact is None:
        return MODELS[name](**given)
    if name == "detector":
        trained = read_detector(artifact)
        return posterior_model(trained) if isinstance(trained, PosteriorArtifact) else detector_model(trained)
    from gossamer_models import fractional  # slow to import, and rarely needed

    if artifact_schema(artifact) != fractional.SCHEMA:
        return MODELS[name](SensorArtifact.read(artifact), **given)
    if name == "sensor":
        return fractional.fractional_sensor_model(fractional.FractionalArtifact.read(artifact))
    msg = (
        f"{artifact} holds a fractional model, which has no inverse: no compensator can be built from it. For a "
        "compensator, identify the same records with --model preisach; or build the sensor alone."
    )
    raise ParameterError(msg)
