"""Build FMUs from step models, reproducible to the byte: native ones, and ones that run in Python.

A native FMU holds C code and what it was compiled to::

    modelDescription.xml
    binaries/<platform>/<name>.<so|dll|dylib>
    documentation/index.html, diagram.*, licenses/
    sources/                                 see ``native``

A Python FMU holds one generic slave and the serialized step model. It is laid out as pythonfmu 0.7.0 does it (its own
builder stamps times and random identifiers, and leaves the module search path changed)::

    modelDescription.xml
    binaries/<platform>/<name>.<so|dll>      pythonfmu's library, which starts Python
    documentation/index.html, diagram.*, licenses/
    resources/slavemodule.txt                names the slave
    resources/slave_<digest>.py              imports the slave from the package
    resources/step_<digest>/                 the slave and what it imports: the stepper and pythonfmu's base class
    resources/model.json, init.casadi, step.casadi
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import uuid
import zipfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gossamer_models
from gossamer_models import ParameterError, StepModel
from gossamer_models.artifacts import artifact_schema
from gossamer_models.compensator import compensator_model
from gossamer_models.detector import DetectorArtifact, detector_model
from gossamer_models.fractional import SCHEMA as FRACTIONAL
from gossamer_models.fractional import FractionalArtifact, fractional_sensor_model
from gossamer_models.membrane import membrane_model
from gossamer_models.sensor import SensorArtifact, sensor_model

from . import native
from .description import build_description, documentation, model_description, model_description_3
from .diagram import diagrams
from .interface import NAMES, Interface, read_interface
from .native import FmiVersion

MODELS: dict[str, Callable[..., StepModel]] = {
    "membrane": membrane_model,
    "sensor": sensor_model,
    "compensator": compensator_model,
    "detector": detector_model,
}
_CHOICES = {
    "membrane": ("elements_per_side",),
    "sensor": ("artifact",),
    "compensator": ("artifact", "method"),
    "detector": ("artifact",),
}
_HAS_NO = {
    "artifact": "FMU {!r} is not built from an artifact. Name the FMUs to build: sensor compensator, or detector.",
    "elements_per_side": "FMU {!r} has no mesh. Name the membrane alone to choose its elements per side.",
    "method": "FMU {!r} has no method. Name the compensator alone to choose its method.",
}
_STEP_FILES = ("errors.py", "variables.py", "step_model.py", "stepper.py")
_PYTHONFMU_FILES = ("_version.py", "default_experiment.py", "enums.py", "fmi2slave.py", "logmsg.py", "variables.py")
# pythonfmu 0.7.0 runs this text again for every instance: whatever it defined would stay in memory each time. It also drops
# a reference to the module's globals that it never took; without the one added here they would be freed under the host.
_ENTRY = """import ctypes

from {package}.slave import GossamerSlave

ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
"""
_NAMESPACE = uuid.UUID("6f2ad6c2-5a57-5d3c-9c1d-2f4a3c1f6d10")


def build_fmu(model: StepModel, folder: Path, interface: Interface | None = None) -> Path:
    """Build an FMU of FMI 2.0 that runs in Python, through pythonfmu.

    Parameters
    ----------
    model : StepModel
        What it runs.
    folder : Path
        Where ``<model name>.fmu`` is written; made if needed.
    interface : Interface, optional
        By default that of this project's FMU of the same name.

    Returns
    -------
    Path
        The FMU. The same model, interface and package versions give the same bytes.
    """
    interface = interface or read_interface(model.name)
    members = {f"resources/{name}": data for name, data in _resources(model).items()}
    for library in sorted((_package_folder("pythonfmu") / "resources/binaries").rglob("*.*")):
        members[f"binaries/{library.parent.name}/{model.name}{library.suffix}"] = library.read_bytes()
    members |= _documents(model, interface)
    describe = partial(model_description, model, interface, native=False)
    members["modelDescription.xml"] = describe(_identifier(members, describe("")))
    return _write(folder / f"{model.name}.fmu", members)


def build_native_fmu(
    model: StepModel,
    folder: Path,
    interface: Interface | None = None,
    *,
    fmi: FmiVersion = 2,
    platforms: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Path:
    """Build an FMU of compiled C, which needs nothing where it runs.

    Parameters
    ----------
    model : StepModel
        What it runs, best built with ``compiled=True`` where it has that choice.
    folder : Path
        Where ``<model name>.fmu`` is written; made if needed.
    interface : Interface, optional
        By default that of this project's FMU of the same name.
    fmi : {2, 3}
        Version of the standard.
    platforms : iterable of str
        Keys of ``native.PLATFORMS``, or ``all``; by default the one this program runs on.
    progress : callable
        Told what is being compiled.

    Returns
    -------
    Path
        The FMU. The same model, interface, compiler and package versions give the same bytes.

    Raises
    ------
    ParameterError
        A platform is unknown or not part of this version of the standard.
    ModuleNotFoundError
        The compiler is not installed.
    """
    pairs = [(model, interface or read_interface(model.name))]
    return _build_native(pairs, folder, fmi=fmi, platforms=platforms, progress=progress)[0]


def build_all(
    folder: Path,
    names: Iterable[str] = NAMES,
    *,
    artifact: Path | None = None,
    elements_per_side: int | None = None,
    method: str | None = None,
    native: bool = False,
    fmi: FmiVersion = 2,
    platforms: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Path]:
    """Build this project's FMUs, all or some of them.

    Parameters
    ----------
    folder : Path
        Where they are written.
    names : iterable of str
        Which ones.
    artifact : Path, optional
        Identified sensor, of either family, or trained detector; every FMU named must be built from this kind of
        artifact.
    elements_per_side : int, optional
        Mesh of the membrane, which must be the only name.
    method : str, optional
        How the compensator recovers strain, which must be the only name; see ``compensator_model``.
    native : bool
        True: compiled C; False: FMUs that run in Python.
    fmi, platforms, progress
        See ``build_native_fmu``; for native FMUs only.

    Returns
    -------
    dict
        Path by name.

    Raises
    ------
    ParameterError
        An option that an FMU does not have.
    ArtifactError
        The artifact cannot be used.
    ModuleNotFoundError
        The compiler is not installed.
    """
    if not native and (fmi != 2 or tuple(platforms)):
        msg = "FMUs that run in Python are of FMI 2.0 and the same for every platform. Add --native."
        raise ParameterError(msg)
    choices = {"artifact": artifact, "elements_per_side": elements_per_side, "method": method}
    models = {name: _model(name, choices, compiled=native) for name in names}  # all or nothing
    if not native:
        return {name: build_fmu(model, folder) for name, model in models.items()}
    pairs = [(model, read_interface(name)) for name, model in models.items()]
    paths = _build_native(pairs, folder, fmi=fmi, platforms=platforms, progress=progress)
    return dict(zip(models, paths, strict=True))


def _build_native(
    pairs: list[tuple[StepModel, Interface]],
    folder: Path,
    *,
    fmi: FmiVersion,
    platforms: Iterable[str],
    progress: Callable[[str], None],
) -> list[Path]:
    """Write the sources of all, compile them side by side (the compiler is a program of its own), and pack them."""
    prepared = []
    for model, interface in pairs:
        describe = partial(model_description, model, interface, native=True)
        if fmi == 3:
            describe = partial(model_description_3, model, interface)
        members, files = _documents(model, interface), native.sources(model, "", fmi)
        guid = _identifier(members | files, describe(""))
        members["modelDescription.xml"] = describe(guid)
        prepared.append((model.name, native.with_guid(files, guid), members))
        if fmi == 3:
            members["sources/buildDescription.xml"] = build_description(model)

    def compile_one(job: tuple[int, str]) -> dict[str, bytes]:
        name, files, _ = prepared[job[0]]
        progress(f"{name} for {job[1]}")
        return native.compile_library(files, name, fmi, job[1])

    jobs = [(k, platform) for platform in native.chosen(platforms, fmi) for k in range(len(prepared))]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for (k, _), libraries in zip(jobs, pool.map(compile_one, jobs), strict=True):
            prepared[k][2].update({f"binaries/{name}": data for name, data in libraries.items()})
    return [
        _write(folder / f"{name}.fmu", members | {f"sources/{file}": data for file, data in files.items()})
        for name, files, members in prepared
    ]


def _model(name: str, choices: dict[str, Any], *, compiled: bool) -> StepModel:
    """Build the model of one FMU; refuse a choice that it does not have."""
    given = {option: value for option, value in choices.items() if value is not None}
    for option in given:
        if option not in _CHOICES[name]:
            raise ParameterError(_HAS_NO[option].format(name))
    artifact = given.pop("artifact", None)
    if name == "membrane":
        return membrane_model(**given, compiled=compiled)
    if artifact is None:
        return MODELS[name](**given)
    if name == "detector":
        return detector_model(DetectorArtifact.read(artifact))
    if artifact_schema(artifact) != FRACTIONAL:
        return MODELS[name](SensorArtifact.read(artifact), **given)
    if name == "sensor":
        return fractional_sensor_model(FractionalArtifact.read(artifact))
    msg = (
        f"{artifact} holds a fractional model, which has no inverse: no compensator can be built from it. Identify the "
        "same records with --model preisach for one, or build the sensor alone."
    )
    raise ParameterError(msg)


def _documents(model: StepModel, interface: Interface) -> dict[str, bytes]:
    pages = {"index.html": documentation(model, interface).encode(), "licenses/license.txt": _license()}
    return {f"documentation/{name}": data for name, data in (pages | diagrams(model)).items()}


def _identifier(members: dict[str, bytes], description: bytes) -> str:
    """Return the guid that belongs to some content."""
    content = hashlib.sha256()
    for name, data in sorted((members | {"modelDescription.xml": description}).items()):
        content.update(name.encode() + b"\0" + data + b"\0")
    return f"{{{uuid.uuid5(_NAMESPACE, content.hexdigest())}}}"


def _write(path: Path, members: dict[str, bytes]) -> Path:
    """Write an archive that depends on nothing but its content."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".partial")
    try:
        with zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in sorted(members.items(), key=lambda item: (item[0] != "modelDescription.xml", item[0])):
                member = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
                member.compress_type = zipfile.ZIP_DEFLATED
                member.external_attr = 0o644 << 16
                member.create_system = 3
                archive.writestr(member, data)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
    return path


def _resources(model: StepModel) -> dict[str, bytes]:
    """Return the files below ``resources/`` by name."""
    models, pythonfmu = Path(gossamer_models.__file__).parent, _package_folder("pythonfmu")
    slave = Path(__file__).with_name("slave.py").read_text(encoding="utf-8")
    code = {"__init__.py": b"", "pythonfmu/__init__.py": b""}
    code |= {name: (models / name).read_bytes() for name in _STEP_FILES}
    code |= {f"pythonfmu/{name}": (pythonfmu / name).read_bytes() for name in _PYTHONFMU_FILES}
    digest = hashlib.sha256(
        b"\0".join([model.digest.encode(), slave.encode(), _ENTRY.encode(), *code.values()])
    ).hexdigest()[:16]
    package = f"step_{digest}"
    slave = slave.replace("from gossamer_models.", f"from {package}.").replace(
        "from pythonfmu.", f"from {package}.pythonfmu."
    )
    files = {f"{package}/{name}": data for name, data in code.items()}
    files[f"{package}/slave.py"] = slave.encode()
    files[f"slave_{digest}.py"] = _ENTRY.format(package=package).encode()
    files["slavemodule.txt"] = f"slave_{digest}".encode()
    with TemporaryDirectory() as temporary:
        model.save(Path(temporary))
        files |= {path.name: path.read_bytes() for path in Path(temporary).iterdir()}
    return files


def _package_folder(name: str) -> Path:
    """Find an installed package without importing it."""
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        msg = f"the package {name!r} is not installed. Install Gossamer with its dependencies."
        raise ModuleNotFoundError(msg)
    return Path(spec.origin).parent


def _license() -> bytes:
    from importlib.metadata import files

    for file in files("gossamer") or []:
        if file.name == "LICENSE":
            return Path(str(file.locate())).read_bytes()
    return b"BSD-3-Clause\n"
