"""FMU files: build them, look into them, check them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.inputs import check_outputs
from gossamer_files.options import option
from gossamer_orchestrator.errors import FmuError, require

from .arguments import File, FmiVersion, Folder, Name, Names, Scales, command, several
from .results import Result
from .working import kinds_of, need_setup, say, stderr

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.table import Table

MOST_ROWS = 2000  # a table of more takes minutes to lay out
CAUSALITIES = ("structuralParameter", "parameter", "input", "output")
HEADINGS = ("variable", "causality", "type", "unit", "start", "min", "max", "description")


class Fmus(Result, dict[str, Path]):
    """FMUs that were built, paths by name.

    Attributes
    ----------
    fmi : int
        Version of the standard.
    native : bool
        Whether they run without Python.
    """

    def __init__(self, paths: dict[str, Path], *, fmi: int, native: bool) -> None:
        super().__init__(paths)
        self.fmi, self.native, self.files = fmi, native, list(paths.values())

    @property
    def sentence(self) -> str:
        """What they run in."""
        return f"FMI {self.fmi}.0: {kinds_of(self.files)}"

    def lines(self) -> list[str]:
        """Return what they run in."""
        return [self.sentence]

    def to_json(self) -> dict[str, Any]:
        """Return paths by name."""
        return {"fmi": self.fmi, "native": self.native, "fmus": dict(self)}

    __repr__ = dict.__repr__


@command
def build(
    names: Names | None = None,
    *,
    out: Folder = "out/fmus",
    artifact: File | None = None,
    scales: Scales | None = None,
    elements_per_side: int | None = None,
    order: int | None = None,
    law: Name | None = None,
    setup: File | None = None,
    mesh: File | None = None,
    expose: bool = False,
    frame: bool = False,
    native: bool = False,
    platform: Names | None = None,
    fmi: FmiVersion = 2,
) -> Fmus:
    """Build FMUs.

    Native FMUs need the compiler that make installs, or pip install ziglang==0.17.0.

    Parameters
    ----------
    names
        FMUs to build: membrane, sensor, compensator, estimator (a compensator that tolerates noise), filter (one for any
        sensor), detector: these six by default; framed_membrane (one that a spacecraft carries and feels), hub (a rigid
        spacecraft).
    out
        Folder to write them to.
    artifact
        Identified sensor (for sensor, compensator, estimator and filter) or trained detector: its file, or nominal, wide or
        single_damage, which ship with Gossamer.
    scales
        Of the identified sensor, in place of its own: resistance at rest [ohm], its rise to full scale [ohm] and full scale
        [1].
    elements_per_side
        Elements along a side of the membrane, a multiple of 4; 4 by default.
    order
        Order of the membrane's elements: 1 for bilinear ones, 2 to 12 for spectral ones; 4 by default. 6 halves the error
        and takes seven times as long.
    law
        Law of the membrane's material, the first by default: st_venant_kirchhoff (carries compression), hencky (linear in
        the logarithmic strain, for large strain), neo_hookean (rubber, for large strain), relaxed (wrinkles where the
        membrane would be compressed).
    setup
        Membrane on a mesh: TOML file with its material, supports, zones, loads and sensors (docs/setup.md), or sail, drum,
        reflector, tube, which ship with Gossamer.
    mesh
        With a setup: mesh file (.msh of gmsh, or any other that meshio reads) in place of the setup's own.
    expose
        With a setup: make the displacement of every node a variable.
    frame
        Put the membrane on a frame that flies: build framed_membrane in place of membrane.
    native
        Compile C code, so that the FMU runs without Python.
    platform
        Of native FMUs: linux64, win64, darwin64, aarch64-linux (FMI 3 only) or all; may be repeated; this machine's
        platform by default.
    fmi
        Of native FMUs: version of the standard, 2 or 3.

    Returns
    -------
    Fmus
        A dictionary of paths by name.

    Examples
    --------
    >>> gossamer.build("membrane", order=6)

    On the command line::

        gossamer build

        gossamer build --native --platform all

        gossamer build --native --fmi 3 --out out/fmus3

        gossamer build membrane --order 6

        gossamer build membrane --elements-per-side 8 --order 1

        gossamer build membrane --law relaxed

        gossamer build membrane --setup sail --out out/sail

        gossamer build membrane --setup mine.toml --mesh mine.msh --native

        gossamer build membrane --frame --native

        gossamer build estimator --artifact out/mine/sensor.json

        gossamer build filter --native --artifact out/mine/sensor.json

        gossamer build detector --artifact wide --out somewhere
    """
    wanted = several(names)
    if frame and "membrane" not in wanted:
        msg = f"{option('frame', True)} puts the membrane on a frame: name it, as in 'gossamer build membrane --frame'."
        raise FmuError(msg)
    wanted = ["framed_membrane" if frame and name == "membrane" else name for name in wanted]
    check_outputs(Path(out) / f"{name}.fmu" for name in wanted)
    structure = None
    if setup is not None:
        from .descriptions import load_structure

        structure = load_structure(setup, mesh, expose=expose)
        for remark in structure.remarks:
            say(remark)
    else:
        need_setup(mesh=mesh, expose=expose or None)
    paths = build_fmus(
        Path(out),
        wanted,
        artifact=None if artifact is None else Path(artifact),
        scales=scales,
        platforms=tuple(several(platform)),
        structure=structure,
        elements_per_side=elements_per_side,
        order=order,
        law=law,
        native=native,
        fmi=fmi,
    )
    return Fmus(paths, fmi=fmi, native=native)


def build_fmus(folder: Path, names: Sequence[str] = (), **options: Any) -> dict[str, Path]:  # noqa: ANN401
    """Build FMUs into a folder, those of the chain if none is named, and say what is replaced by something else."""
    from gossamer_fmus import CHAIN, NAMES, build_all
    from gossamer_orchestrator.names import suggest

    for name in names:
        require(name in NAMES, f"there is no FMU {name!r} to build. {suggest(name, NAMES)}", FmuError)
    before = {name: _description(folder / f"{name}.fmu") for name in names or CHAIN}
    console = stderr()
    with console.status("building FMUs") as status:

        def progress(text: str) -> None:
            if console.is_terminal:
                status.update(f"compiling {text}; a first time for a platform takes minutes")
            else:
                say(f"compiling {text}")

        paths = build_all(folder, names or CHAIN, progress=progress, **options)
    for name, path in paths.items():
        if before[name] and before[name] != (now := _description(path)):
            what = f"{path} is now '{now}' in place of '{before[name]}', which other scenarios may need."
            say(f"{what} {option('out')} keeps both.")
    return paths


def _description(path: Path) -> str:
    """Return what an FMU says that it is; nothing if there is none that can be read."""
    from gossamer_orchestrator import FmuFile

    try:
        return (FmuFile(path, validate=False).description.description or "") if path.is_file() else ""
    except FmuError:
        return ""


@dataclass(frozen=True, kw_only=True, repr=False)
class FmuInfo(Result):
    """An FMU.

    Attributes
    ----------
    path : Path
        The FMU.
    name, description : str
        What it is.
    fmi : str
        Version of the standard.
    variables : dict of str to mapping
        By name: causality, type, unit, start, min, max and description, None where the FMU does not say; for pandas,
        ``pandas.DataFrame(info.variables).T``.
    """

    path: Path
    name: str
    description: str
    fmi: str
    variables: Mapping[str, Mapping[str, Any]]
    TABLES = "stdout"

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"FmuInfo({str(self.path)!r}: {self.description}, FMI {self.fmi}, {len(self.variables)} variables)"

    @property
    def sentence(self) -> str:
        """What it is."""
        return f"{self.name}: {self.description}"

    def tables(self) -> Sequence[Table | str]:
        """Return the variables, a section for each causality; a line each with tabs where they are too many."""
        from rich.markup import escape
        from rich.table import Table

        rows = {
            name: [name, *("" if cell is None else str(cell) for cell in each.values())]
            for name, each in self.variables.items()
        }
        if len(rows) > MOST_ROWS:
            return ["\n".join("\t".join(cells) for cells in rows.values())]
        table = Table(title=escape(self.sentence), expand=False)
        for heading in HEADINGS:
            table.add_column(heading, overflow="fold", no_wrap=heading in ("variable", "causality", "type"))
        for _, group in groupby(rows, key=lambda name: self.variables[name]["causality"]):
            for name in group:
                table.add_row(*map(escape, rows[name]))
            table.add_section()
        return [table]

    def to_json(self) -> dict[str, Any]:
        """Return the variables as a list."""
        variables = [{"variable": name, **each} for name, each in self.variables.items()]
        return {"name": self.name, "description": self.description, "fmi": self.fmi, "variables": variables}


@command
def info(fmu: File, *, locals: bool = False) -> FmuInfo:
    """Look into an FMU: parameters, inputs and outputs.

    More than 2000 variables are printed a line each, with tabs between the columns.

    Parameters
    ----------
    fmu
        An FMU file.
    locals
        List local variables too.

    Returns
    -------
    FmuInfo
        Variables by name; displayed in a notebook.

    Examples
    --------
    >>> gossamer.info("out/fmus/sensor.fmu").variables["rest_strain"]["unit"]

    On the command line::

        gossamer info out/fmus/sensor.fmu
    """
    from gossamer_orchestrator import FmuFile

    file = FmuFile(Path(fmu), validate=False)
    about = file.description
    groups: dict[str, dict[str, dict[str, Any]]] = {each: {} for each in (*CAUSALITIES, *["local"] * locals)}
    for v in about.modelVariables:
        if v.causality in groups:
            kind = f"{v.type}[{','.join(map(str, v.shape))}]" if v.shape else v.type
            unit = v.unit or (v.declaredType.unit if v.declaredType is not None else None)
            cells = (v.causality, kind, unit, v.start, v.min, v.max, v.description)
            groups[v.causality][v.name] = dict(zip(HEADINGS[1:], cells, strict=True))
    return FmuInfo(
        path=Path(fmu),
        name=file.name,
        description=about.description or about.modelName,
        fmi=about.fmiVersion,
        variables={name: each for group in groups.values() for name, each in group.items()},
    )
