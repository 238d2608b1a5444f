"""The FMUs of this project by name: their files and their models."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypedDict, Unpack

from gossamer_files.options import option
from gossamer_models import ParameterError, StepModel
from gossamer_models.artifacts import artifact_schema
from gossamer_models.compensator import compensator_model
from gossamer_models.detector import PosteriorArtifact, detector_model, posterior_model, read_detector
from gossamer_models.hub import hub_model
from gossamer_models.membrane import Structure, membrane_model, square_structure
from gossamer_models.sensor import Scales, SensorArtifact, default_artifact, sensor_model

log = logging.getLogger(__name__)

MODELS: dict[str, Callable[..., StepModel]] = {
    "membrane": membrane_model,
    "sensor": sensor_model,
    "compensator": partial(compensator_model, ageing=True),
    "estimator": partial(compensator_model, method="estimator", ageing=True),  # a compensator that tolerates noise
    "filter": partial(compensator_model, method="filter", ageing=True),  # a compensator of any sensor
    "detector": posterior_model,
    "framed_membrane": partial(membrane_model, frame=True),  # a membrane that a spacecraft carries and feels
    "hub": hub_model,
}
NAMES = tuple(MODELS)
CHAIN = ("membrane", "sensor", "compensator", "estimator", "filter", "detector")  # those of the monitoring chain
_MEMBRANES = ("membrane", "framed_membrane")
_COMPENSATORS = ("compensator", "estimator", "filter")
_SENSORS = ("sensor", *_COMPENSATORS)

# The FMUs that have an option, and what the refusal says of another.
_OPTIONS = {
    "artifact": ((*_SENSORS, "detector"), "is not built from an artifact. Name those that are: {}."),
    "scales": (_SENSORS, "has no scales of a sensor. Name those that have: {}."),
    "elements_per_side": (_MEMBRANES, "has no mesh. Name a membrane alone to choose its elements per side."),
    "order": (_MEMBRANES, "has no mesh. Name a membrane alone to choose the order of its elements."),
    "law": (_MEMBRANES, "has no law of a material. Name a membrane alone to choose it."),
    "structure": ((*_MEMBRANES, "detector"), "is not built from a mesh. Name a membrane alone with a setup."),
    "ageing": (_COMPENSATORS, "follows no gain and offset. Name one of those that do: {}."),
}
_SCALES = "resistance at rest [ohm], its rise to full scale [ohm] and full scale [1], for instance 1000,150,0.2."


class ModelOptions(TypedDict, total=False):
    """What a model is made from; None stands for the default.

    Attributes
    ----------
    artifact : Path
        Identified sensor, of either family, or trained detector; every FMU named must be built from this kind of artifact.
    scales : tuple of float
        Resistance at rest [ohm], its rise to full scale [ohm] and full scale [1] of an identified sensor, in place of its
        own; needed where it has none.
    elements_per_side, order : int
        Mesh of the membrane, which must be the only name; see ``membrane_model``.
    law : str
        Law of the membrane's material, one of ``gossamer_models.membrane.LAWS``.
    structure : Structure
        Membrane on a mesh in place of the square one; that which the detector should be trained for.
    ageing : bool
        Whether a compensator follows gain and offset of its sensor, as it does by default.
    """

    artifact: Path | None
    scales: tuple[float, ...] | None
    elements_per_side: int | None
    order: int | None
    law: str | None
    structure: Structure | None
    ageing: bool | None


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


def make_model(name: str, *, compiled: bool = False, **options: Unpack[ModelOptions]) -> StepModel:
    """Make the model of one of the FMUs.

    Parameters
    ----------
    name : str
        One of ``NAMES``.
    compiled : bool
        Whether to use the form of the model for compilation, if it has one.
    **options
        See ``ModelOptions``.

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
    given: dict[str, Any] = {key: value for key, value in options.items() if value is not None}
    for key in given:
        having, refusal = _OPTIONS[key]
        if name not in having:
            msg = f"FMU {name!r} {refusal.format(', '.join(having[:-1]) + ' or ' + having[-1])}"
            raise ParameterError(msg)
    if name in _MEMBRANES:
        structure = given.pop("structure", None)
        if structure is not None and given:
            msg = f"{option(min(given))} has no meaning with {option('setup')}, which says it itself. Leave it out."
            raise ParameterError(msg)
        return MODELS[name](square_structure(**given) if structure is None else structure, compiled=compiled)
    artifact, scales = given.get("artifact"), given.get("scales")
    if name == "detector":
        trained = PosteriorArtifact.default() if artifact is None else read_detector(artifact)
        if (structure := given.get("structure")) is not None:
            trained.require_structure(structure, str(artifact or "nominal"))
        return posterior_model(trained) if isinstance(trained, PosteriorArtifact) else detector_model(trained)
    model = partial(MODELS[name], ageing=given["ageing"]) if "ageing" in given else MODELS[name]
    if artifact is None:
        sensor = () if scales is None else (replace(default_artifact(), scales=_scales(scales)),)
        return model(*sensor)
    from gossamer_models import fractional  # slow to import, and rarely needed

    if artifact_schema(artifact) != fractional.SCHEMA:
        identified = _with_scales(artifact, scales)
        _warn_of_defaults(name, artifact, identified)
        return model(identified)
    if scales is not None:
        msg = f"{artifact} holds a fractional model, which has its own scales. Leave {option('scales')} out."
        raise ParameterError(msg)
    if name == "sensor":
        return fractional.fractional_sensor_model(fractional.FractionalArtifact.read(artifact))
    advice = f"For a compensator, identify the same records with {option('model', 'preisach')}; or build the sensor alone."
    msg = f"{artifact} holds a fractional model, which has no inverse: no compensator can be built from it. {advice}"
    raise ParameterError(msg)


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
            "%s holds no numbers of a filter: the FMU %s runs with those of an average sensor. Identify it with %s, which "
            "measures them.",
            path,
            name,
            option("model", "auto"),
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
            "100 ohm more at full scale, and 50 % strain, which are those of no sensor. State its own "
            f"({option('scales')}): {_SCALES} Or identify it again with its resistance at rest "
            f"({option('rest_resistance')})."
        )
        raise ParameterError(msg)
    return artifact
