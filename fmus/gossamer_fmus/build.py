"""Build native FMUs and Python FMUs from step models, reproducible to the byte.

Both kinds hold::

    modelDescription.xml                     see ``description``
    documentation/                           see ``page``

A native FMU also holds its C code and the compiled binaries::

    binaries/<platform>/<name>.<so|dll|dylib>
    sources/                                 see ``c_code``

An FMU of a model with files of its own holds them too::

    resources/                               see ``resources``

A Python FMU holds one generic slave and the serialized step model instead; see ``python_fmu``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from gossamer_models import GossamerError, ParameterError, StepModel

from .archive import identifier, write_archive
from .c_code import sources, with_guid
from .catalogue import NAMES, make_model
from .compiler import choose_platforms, compile_library
from .description import FmiVersion, build_description, model_description
from .loop_code import FILE
from .page import documents
from .python_fmu import python_members
from .resources import resources

if TYPE_CHECKING:
    from gossamer_models.membrane import Structure


def build_fmu(
    model: StepModel,
    folder: Path,
    readme: Path | None = None,
    *,
    native: bool = False,
    fmi: FmiVersion = 2,
    platforms: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Path:
    """Build an FMU.

    Parameters
    ----------
    model : StepModel
        Model to run; for a native FMU, create it with ``compiled=True`` if it has that option.
    folder : Path
        Folder for ``<model name>.fmu``; created if needed.
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
    Path
        The FMU. The same model, README, compiler and package versions give the same bytes.

    Raises
    ------
    ParameterError
        A platform is unknown or not part of this version of the standard, or is given for an FMU that is not native.
    ModuleNotFoundError
        The compiler is not installed.
    """
    return _build([(model.name, model, readme)], folder, native, fmi, platforms, progress)[0]


def build_all(
    folder: Path,
    names: Iterable[str] = NAMES,
    *,
    artifact: Path | None = None,
    scales: tuple[float, ...] | None = None,
    elements_per_side: int | None = None,
    order: int | None = None,
    law: str | None = None,
    structure: Structure | None = None,
    native: bool = False,
    fmi: FmiVersion = 2,
    platforms: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Path]:
    """Build this project's FMUs, all or some of them.

    Parameters
    ----------
    folder : Path
        Folder for the FMUs.
    names : iterable of str
        FMUs to build.
    artifact : Path, optional
        Identified sensor, of either family, or trained detector; every FMU named must be built from this kind of
        artifact.
    scales : tuple of float, optional
        Resistance at rest [ohm], its rise to full scale [ohm] and full scale [1] of an identified sensor, in place of its
        own; needed where it has none.
    elements_per_side, order : int, optional
        Mesh of the membrane, which must be the only name; see ``membrane_model``.
    law : str, optional
        Law of the membrane's material: st_venant_kirchhoff, hencky, neo_hookean or relaxed.
    structure : Structure, optional
        Membrane on a mesh in place of the square one.
    native, fmi, platforms, progress
        See ``build_fmu``.

    Returns
    -------
    dict
        Path by name.

    Raises
    ------
    ParameterError
        An option that an FMU does not have, or as ``build_fmu`` raises it.
    ArtifactError
        The artifact cannot be used.
    ModuleNotFoundError
        The compiler is not installed.
    """
    options = {
        "artifact": artifact,
        "scales": scales,
        "elements_per_side": elements_per_side,
        "order": order,
        "law": law,
        "structure": structure,
    }
    names, models = tuple(names), dict[str, StepModel]()
    for name in names:
        try:
            models[name] = make_model(name, compiled=native, **options)
        except GossamerError as error:
            if len(names) > 1:
                error.add_note(f"That was {name}; none of {', '.join(names)} was written.")
            raise
    named = [(name, model, None) for name, model in models.items()]
    paths = _build(named, folder, native, fmi, platforms, progress)
    return dict(zip(models, paths, strict=True))


def _build(
    models: Iterable[tuple[str, StepModel, Path | None]],
    folder: Path,
    native: bool,
    fmi: FmiVersion,
    platforms: Iterable[str],
    progress: Callable[[str], None],
) -> list[Path]:
    """Write the files of all FMUs, compile them in parallel (the compiler is a separate program), and pack them by name."""
    platforms = tuple(platforms)
    if not native and (fmi != 2 or platforms):
        msg = "FMUs that run in Python are of FMI 2.0 and the same for every platform. Add --native."
        raise ParameterError(msg)
    platforms = choose_platforms(platforms, fmi) if native else ()
    fmus = []
    for name, model, readme in models:
        code = sources(model, "", fmi) if native else {}
        members = documents(model, readme) | ({} if native else python_members(model)) | resources(model, native=native)
        if model.tables is not None:
            members[f"resources/{FILE}"] = model.tables.content()
        description = {"modelDescription.xml": model_description(model, "", fmi=fmi, native=native)}
        guid = identifier(members | code | description)
        code = with_guid(code, guid) if native else {}
        members |= {f"sources/{name}": content for name, content in code.items()}
        members["modelDescription.xml"] = model_description(model, guid, fmi=fmi, native=native)
        if fmi == 3:
            members["sources/buildDescription.xml"] = build_description(model)
        fmus.append((name, model.name, code, members))

    def compile_one(job: tuple[str, tuple[str, str, dict[str, bytes], dict[str, bytes]]]) -> None:
        platform, (name, library, code, members) = job
        begin = partial(progress, f"{name} for {platform}")
        members.update(compile_library(code, library, fmi, platform, begin))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_one, product(platforms, fmus)))
    return [write_archive(folder / f"{name}.fmu", members) for name, _, _, members in fmus]
