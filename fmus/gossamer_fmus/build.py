"""Build native FMUs and Python FMUs from step models, reproducible to the byte.

Both kinds hold::

    modelDescription.xml                     see ``description``
    documentation/                           see ``page``
    extra/org.fmi-standard.fmi-ls-ref/       see ``reference``

A native FMU also holds its C code and the compiled binaries::

    binaries/<platform>/<name>.<so|dll|dylib>
    sources/, resources/tables.bin           see ``c_code``
    extra/org.fmi-standard.fmi-ls-xcp/       see ``a2l``

A Python FMU holds pythonfmu's library, one generic slave, and the serialized step model instead, laid out as pythonfmu 0.7.0
does it (its own builder stamps times and random identifiers, and leaves the module search path changed)::

    binaries/<platform>/<name>.<so|dll>      pythonfmu's library, which starts Python
    resources/slavemodule.txt                names the slave
    resources/slave_<digest>.py              imports the slave from the package
    resources/step_<digest>/                 the slave and what it imports: the stepper and pythonfmu's base class
    resources/model.json, init.casadi, step.casadi

An FMU of a model with files of its own, for programs that draw it, holds them too::

    resources/<name>                         as the model has it
    resources/state.json                     where variables and state of the model lie in a serialized state of the FMU
"""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Unpack

from gossamer_files import MIXED, replacing_all, uninterrupted, write_archive
from gossamer_files.options import option
from gossamer_models import GossamerError, ParameterError, StepModel

from .a2l import VALUES_OFFSET, descriptions
from .c_code import TABLES_FILE, sources, with_guid
from .catalogue import NAMES, ModelOptions, make_model, package_folder
from .compiler import choose_platforms, compile_library
from .description import FmiVersion, build_description, model_description
from .page import documents
from .reference import references

_NAMESPACE = uuid.UUID("6f2ad6c2-5a57-5d3c-9c1d-2f4a3c1f6d10")
_HEAD = 8 + 16 + 4  # of a state: magic, digest and checksum [byte], in both kinds
_BEFORE = {True: VALUES_OFFSET, False: 1}  # the variables: in C (stepper.h, State) and in Python (stepper.py)
_STEP_FILES = ("errors.py", "variables.py", "step_model.py", "stepper.py")
_PYTHONFMU_FILES = ("_version.py", "default_experiment.py", "enums.py", "fmi2slave.py", "logmsg.py", "variables.py")
# pythonfmu 0.7.0 runs this text again for every instance: whatever it defined would stay in memory each time. It also drops
# a reference to the module's globals that it never took; without the one added here they would be freed under the host.
_ENTRY = """import ctypes

from {package}.slave import GossamerSlave

ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
"""


def build_all(
    folder: Path,
    names: Iterable[str] = NAMES,
    *,
    native: bool = False,
    fmi: FmiVersion = 2,
    platforms: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
    **options: Unpack[ModelOptions],
) -> dict[str, Path]:
    """Build this project's FMUs, all or some of them.

    Parameters
    ----------
    folder : Path
        Folder for the FMUs.
    names : iterable of str
        FMUs to build.
    native, fmi, platforms, progress
        See ``build_models``.
    **options
        What the models are made from; see ``ModelOptions``.

    Returns
    -------
    dict
        Path by name.

    Raises
    ------
    ParameterError
        An option that an FMU does not have, or as ``build_models`` raises it.
    ArtifactError
        The artifact cannot be used.
    ModuleNotFoundError
        The compiler is not installed.
    """
    names, models = tuple(names), dict[str, StepModel]()
    for name in names:
        try:
            models[name] = make_model(name, compiled=native, **options)
        except GossamerError as error:
            if len(names) > 1:
                error.add_note(f"That was {name}; none of {', '.join(names)} was written.")
            raise
    return build_models(models, folder, native=native, fmi=fmi, platforms=platforms, progress=progress)


def build_models(
    models: Mapping[str, StepModel],
    folder: Path,
    readme: Path | None = None,
    *,
    native: bool = False,
    fmi: FmiVersion = 2,
    platforms: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Path]:
    """Build FMUs: write the files of all, compile them in parallel (the compiler is a separate program), and pack them.

    Parameters
    ----------
    models : mapping of str to StepModel
        Models to run, by the names of their files; for native FMUs, create them with ``compiled=True`` if they have that
        option.
    folder : Path
        Folder for ``<name>.fmu``; created if needed.
    readme : Path, optional
        Text of the documentation page; by default the README of this project's FMU of the same name.
    native : bool
        True: compiled C, which needs nothing on the host; False: an FMU that runs in Python, through pythonfmu.
    fmi : {2, 3}
        Version of the standard; 3 for native FMUs only.
    platforms : iterable of str
        Keys of ``compiler.PLATFORMS``, or ``all``; by default the one this program runs on. For native FMUs only.
    progress : callable
        Receives a line for each library before it is compiled; none for those in the user's cache folder.

    Returns
    -------
    dict
        Path by name. The same model, README, compiler and package versions give the same bytes.

    Raises
    ------
    ParameterError
        A platform is unknown or not part of this version of the standard, or is given for an FMU that is not native.
    ModuleNotFoundError
        The compiler is not installed.
    """
    platforms = tuple(platforms)
    if not native and (fmi != 2 or platforms):
        msg = f"FMUs that run in Python are of FMI 2.0 and the same for every platform. Add {option('native', True)}."
        raise ParameterError(msg)
    platforms = choose_platforms(platforms, fmi) if native else ()
    codes, fmus = dict[str, dict[str, bytes]](), dict[str, dict[str, bytes]]()
    for name, model in models.items():
        code = sources(model, "", fmi) if native else {}
        members = documents(model, readme) | ({} if native else _python_members(model)) | _resources(model, native)
        if TABLES_FILE in code:
            members[f"resources/{TABLES_FILE}"] = code.pop(TABLES_FILE)
        described = {"modelDescription.xml": model_description(model, "", fmi=fmi, native=native)}
        guid = identifier(members | code | described)
        codes[name] = with_guid(code, guid) if native else {}
        members |= {f"sources/{file}": content for file, content in codes[name].items()}
        members["modelDescription.xml"] = model_description(model, guid, fmi=fmi, native=native)
        if fmi == 3:
            members["sources/buildDescription.xml"] = build_description(model)
        fmus[name] = members | references(model, fmi)

    def compile_one(job: tuple[str, str]) -> None:
        platform, name = job
        begin = partial(progress, f"{name} for {platform}")
        libraries = compile_library(codes[name], models[name].name, fmi, platform, begin)
        fmus[name].update(libraries | descriptions(models[name], libraries))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_one, product(platforms, fmus)))
    paths = {name: folder / f"{name}.fmu" for name in fmus}
    mark = folder / MIXED
    with uninterrupted(folder):
        with replacing_all([paths[name] for name in fmus]) as unfinished:
            for place, members in zip(unfinished, fmus.values(), strict=True):
                ordered = sorted(members.items(), key=lambda item: (item[0] != "modelDescription.xml", item[0]))
                write_archive(place, dict(ordered))
            earlier = mark.read_text(encoding="utf-8").split() if mark.is_file() else []
            mark.write_text("\n".join(sorted({*earlier, *paths})), encoding="utf-8")
        mark.unlink(missing_ok=True)
        if left := sorted({*earlier} - {*paths}):
            mark.write_text("\n".join(left), encoding="utf-8")
    return paths


def _resources(model: StepModel, native: bool) -> dict[str, bytes]:
    """Return the model's own files by path, and where its numbers lie in a serialized state.

    ``values`` and ``x`` of ``state.json`` are the places [byte] of the variables, in the order of the table, and of the
    states of the model; both are doubles in the order of this machine's bytes.
    """
    if not model.resources:
        return {}
    begin = _HEAD + _BEFORE[native]
    card = {
        "schema": "gossamer.state",
        "version": 1,
        "values": begin,
        "n_values": len(model.variables),
        "x": begin + 8 * len(model.variables),
        "n_x": model.n_states,
    }
    files = model.resources | {"state.json": json.dumps(card, indent=1).encode()}
    return {f"resources/{name}": data for name, data in files.items()}


def identifier(members: Mapping[str, bytes]) -> str:
    """Return the guid of some files, given by name."""
    content = hashlib.sha256()
    for name, data in sorted(members.items()):
        content.update(name.encode() + b"\0" + data + b"\0")
    return f"{{{uuid.uuid5(_NAMESPACE, content.hexdigest())}}}"


def _python_members(model: StepModel) -> dict[str, bytes]:
    """Return the files below ``binaries/`` and ``resources/`` by path."""
    members = {f"resources/{name}": data for name, data in _python_resources(model).items()}
    for library in sorted((package_folder("pythonfmu") / "resources/binaries").rglob("*.*")):
        members[f"binaries/{library.parent.name}/{model.name}{library.suffix}"] = library.read_bytes()
    return members


def _python_resources(model: StepModel) -> dict[str, bytes]:
    models, pythonfmu = package_folder("gossamer_models"), package_folder("pythonfmu")
    roots = package_folder("gossamer_files") / "errors.py"
    slave = Path(__file__).with_name("slave.py").read_text(encoding="utf-8")
    code = {"__init__.py": b"", "pythonfmu/__init__.py": b""}
    code |= {name: (models / name).read_bytes() for name in _STEP_FILES} | {"roots.py": roots.read_bytes()}
    code["errors.py"] = code["errors.py"].replace(b"from gossamer_files.errors ", b"from .roots ")
    code |= {f"pythonfmu/{name}": (pythonfmu / name).read_bytes() for name in _PYTHONFMU_FILES}
    content = b"\0".join([model.digest.encode(), slave.encode(), _ENTRY.encode(), *code.values()])
    digest = hashlib.sha256(content).hexdigest()[:16]
    package = f"step_{digest}"
    slave = slave.replace("from gossamer_models.", f"from {package}.")
    slave = slave.replace("from pythonfmu.", f"from {package}.pythonfmu.")
    files = {f"{package}/{name}": data for name, data in code.items()}
    files[f"{package}/slave.py"] = slave.encode()
    files[f"slave_{digest}.py"] = _ENTRY.format(package=package).encode()
    files["slavemodule.txt"] = f"slave_{digest}".encode()
    with TemporaryDirectory() as temporary:
        model.save(Path(temporary))
        files |= {path.name: path.read_bytes() for path in Path(temporary).iterdir()}
    return files
