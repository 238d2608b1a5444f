"""The FMUs of this project by name: their files and their models."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_models import ParameterError, StepModel
from gossamer_models.artifacts import artifact_schema
from gossamer_models.compensator import compensator_model
from gossamer_models.detector import PosteriorArtifact, detector_model, posterior_model, read_detector
from gossamer_models.hub import hub_model
from gossamer_models.membrane import membrane_model
from gossamer_models.sensor import Scales, SensorArtifact, default_artifact, sensor_model

if TYPE_CHECKING:
    from gossamer_models.membrane import Structure

log = logging.getLogger(__name__)

MODELS: dict[str, Callable[..., StepModel]] = {
    "membrane": membrane_model,
    "sensor": sensor_model,
    "compensator": compensator_model,
    "estimator": partial(compensator_model, method="estimator"),  # a compensator that tolerates noise
    "filter": partial(compensator_model, method="filter"),  # a compensator of any sensor
    "detector": posterior_model,
    "framed_membrane": partial(membrane_model, frame=True),  # a membrane that a spacecraft carries and feels
    "hub": hub_model,
}
NAMES = tuple(MODELS)
CHAIN = NAMES[:6]  # those of the monitoring chain
MEMBRANES = ("membrane", "framed_membrane")

_OPTIONS = {
    "artifact": CHAIN[1:],
    "scales": NAMES[1:4],
    "elements_per_side": MEMBRANES,
    "order": MEMBRANES,
    "law": MEMBRANES,
    "structure": MEMBRANES,
}  # and the FMUs that have them
_REFUSALS = {
    "scales": "FMU {!r} has no scales of a sensor. Name those that have: sensor, compensator, estimator or filter.",
    "artifact": "FMU {!r} is not built from an artifact. Name those that are: sensor, compensator, estimator, filter or "
    "detector.",
    "elements_per_side": "FMU {!r} has no mesh. Name a membrane alone to choose its elements per side.",
    "order": "FMU {!r} has no mesh. Name a membrane alone to choose the order of its elements.",
    "law": "FMU {!r} has no law of a material. Name a membrane alone to choose it.",
    "structure": "FMU {!r} is not built from a mesh. Name a membrane alone with --setup.",
}
_SCALES = "resistance at rest [ohm], its rise to full scale [ohm] and full scale [1], for instance 1000,150,0.2."


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
        ``artifact``, ``scales``, ``elements_per_side``, ``order``, ``law`` and ``structure`` as in ``build_all``; None
        stands for the default.

    Returns
    -------
    StepModel
        The model.

    Raises
    ------
    ParameterError
        The FMU does not have one of the options, or the sensor has no scales and none are given.
    ArtifactError
        The artifact cannot be used.
    """
    given = {option: value for option, value in options.items() if value is not None}
    for option in given:
        if name not in _OPTIONS[option]:
            raise ParameterError(_REFUSALS[option].format(name))
    artifact, scales = given.pop("artifact", None), given.pop("scales", None)
    if name in MEMBRANES and "structure" in given:
        return _mesh_membrane(**given, frame=name == "framed_membrane", compiled=compiled)
    if name in MEMBRANES:
        return MODELS[name](**given, compiled=compiled)
    if artifact is None:
        return (
            MODELS[name](**given)
            if scales is None
            else MODELS[name](replace(default_artifact(), scales=_scales(scales)))
        )
    if name == "detector":
        trained = read_detector(artifact)
        return posterior_model(trained) if isinstance(trained, PosteriorArtifact) else detector_model(trained)
    from gossamer_models import fractional  # slow to import, and rarely needed

    if artifact_schema(artifact) != fractional.SCHEMA:
        sensor = _with_scales(artifact, scales)
        _warn_of_defaults(name, artifact, sensor)
        return MODELS[name](sensor, **given)
    if scales is not None:
        msg = f"{artifact} holds a fractional model, which has its own scales. Leave --scales out."
        raise ParameterError(msg)
    if name == "sensor":
        return fractional.fractional_sensor_model(fractional.FractionalArtifact.read(artifact))
    msg = (
        f"{artifact} holds a fractional model, which has no inverse: no compensator can be built from it. For a "
        "compensator, identify the same records with --model preisach; or build the sensor alone."
    )
    raise ParameterError(msg)


def _mesh_membrane(structure: Structure, *, frame: bool, compiled: bool, **rest: Any) -> StepModel:  # noqa: ANN401
    if rest:
        msg = f"--{min(rest).replace('_', '-')} has no meaning with --setup, which says it itself. Leave it out."
        raise ParameterError(msg)
    from gossamer_models.membrane import mesh_membrane_model

    return mesh_membrane_model(structure, frame=frame, compiled=compiled)


def _warn_of_defaults(name: str, path: Path, sensor: SensorArtifact) -> None:
    """Say where a compensator starts with numbers that were not measured, and so are not those of this sensor."""
    method = (sensor.compensator or "inverse") if name == "compensator" else name
    if method == "estimator" and sensor.noise is None:
        log.warning(
            "%s holds no measured noise: the FMU %s starts with 0.1 %% of the rise to full scale. Set its noise, or "
            "identify the sensor again.",
            path,
            name,
        )
    if method == "filter" and sensor.tracking is None:
        log.warning(
            "%s holds no numbers of a filter: the FMU %s runs with those of an average sensor. Identify it with --model "
            "auto, which measures them.",
            path,
            name,
        )


def _scales(numbers: tuple[float, ...]) -> Scales:
    names = [f.name for f in fields(Scales)]
    if len(numbers) != len(names):
        msg = f"the scales of a sensor are three numbers, not {len(numbers)}: {_SCALES}"
        raise ParameterError(msg)
    return Scales(**dict(zip(names, numbers, strict=True)))


def _with_scales(path: Path, scales: tuple[float, ...] | None) -> SensorArtifact:
    """Read a sensor with scales, its own or those given; refuse one without: its FMU would start at those of no sensor."""
    artifact = SensorArtifact.read(path)
    if scales is not None:
        return replace(artifact, scales=_scales(scales))
    if artifact.scales is None and artifact != default_artifact():
        msg = (
            f"{path} holds no scales, because its resistance at rest is not positive: FMUs would start at 100 ohm at rest, "
            "100 ohm more at full scale, and 50 % strain, which are those of no sensor. State its own (--scales): "
            f"{_SCALES} Or identify it again with its resistance at rest (--rest-resistance)."
        )
        raise ParameterError(msg)
    return artifact
