"""Small vibrations of a membrane: its modes, and models reduced to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gossamer_files.inputs import check_outputs
from gossamer_files.tables import TableText, number, percent

from .arguments import Count, File, FmiVersion, Folder, Names, Numbers, Values, assigned, command, several
from .records import numbers_by_name, structure_in
from .results import Saved, zone_coordinates
from .working import need_setup, save_page, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from gossamer_models.membrane import Modes, Reach, Reduced, Sensitivities, Structure
    from gossamer_orchestrator.pages import Page


@dataclass(frozen=True, kw_only=True, repr=False)
class MembraneModes(Saved):
    """Modes that were found.

    Attributes
    ----------
    files : list of Path
        Arrays, shapes for ParaView, and page.
    result : gossamer_models.membrane.Modes
        The modes.
    changes : gossamer_models.membrane.Sensitivities
        What damage of each zone does to them.
    """

    result: Modes
    changes: Sensitivities

    @property
    def data(self) -> xr.Dataset:
        """By ``mode``: ``frequency`` [Hz], ``damping_ratio`` [1], ``effective_mass`` [kg], [kg m2] by ``axis`` of the frame,
        ``shape`` [kg^-1/2] of modal mass 1 kg by ``node`` and ``direction``, ``strain`` of it by ``sensor``; by ``zone`` too
        ``frequency_change`` and ``strain_change`` per damage; ``equilibrium`` [m] by ``node``.
        """  # noqa: D205
        import xarray as xr
        from gossamer_models.membrane.vibration import AXES

        found, structure = self.result, self.result.linearised.structure
        per_metre = {"units": "kg^-1/2 m^-1"}
        values: dict[str, Any] = {
            "frequency": ("mode", found.frequencies, {"units": "Hz"}),
            "damping_ratio": ("mode", found.damping_ratios, {"units": "1"}),
            "effective_mass": (("mode", "axis"), found.effective_masses, {"units": "kg, about axes kg m2"}),
            "shape": (("mode", "node", "direction"), found.shapes, {"units": "kg^-1/2"}),
            "equilibrium": (("node", "direction"), found.linearised.displacement, {"units": "m"}),
        }
        coords: dict[str, Any] = {"mode": range(1, len(found.squares) + 1), "axis": list(AXES), "direction": list("xyz")}
        if structure.n_sensors:
            values["strain"] = (("mode", "sensor"), found.strain, per_metre)
        if structure.n_zones:
            coords |= zone_coordinates(structure.zone_names)
            values["frequency_change"] = (("mode", "zone"), self.changes.frequency, {"units": "1"})
            if structure.n_sensors:
                values["strain_change"] = (("mode", "sensor", "zone"), self.changes.strain, per_metre)
        return xr.Dataset(values, coords)

    @property
    def sentence(self) -> str:
        """The range of the frequencies."""
        f = self.result.frequencies
        return f"The slowest {len(f)} modes vibrate at {f[0]:.5g} to {f[-1]:.5g} Hz."

    def lines(self) -> list[str]:
        """Return the range of the frequencies."""
        return [self.sentence]

    def doubts(self) -> list[str]:
        """Return what the frequencies leave out."""
        from gossamer_models.membrane.vibration import FOLLOWING

        share = self.result.linearised.asymmetry
        text = (
            f"Loads that follow the surface take {100.0 * share:.2g} % of the stiffness from its symmetry; the modes are "
            "those of its symmetric part."
        )
        return [text] * (share > FOLLOWING)

    def tables(self) -> list[TableText]:
        """Return the modes, and what damage of each zone does to them."""
        import numpy as np

        found, names = self.result, self.result.linearised.structure.zone_names
        share = found.effective_masses / [max(each, 1e-300) for each in found.moving.diagonal()]
        modes = [
            (str(k + 1), f"{f:.5g}", percent(ratio), *map(percent, row.round(6)))
            for k, (f, ratio, row) in enumerate(zip(found.frequencies, found.damping_ratios, share, strict=True))
        ]
        head = ("mode", "frequency [Hz]", "damping [%]", *("x", "y", "z", "about x", "about y", "about z"))
        tables = [TableText(head, modes, "Modes; effective mass, share of what moves along and about the axes [%]")]
        by_zone = ("mode", *(str(k + 1) for k in range(len(names))))
        for what, values in (("the frequency", self.changes.frequency), ("the strain", self._strain_changes)):
            rows = [
                (str(k + 1), *map(percent, row)) for k, row in enumerate(values) if len(names) and np.isfinite(row).any()
            ]
            tables.append(TableText(by_zone, rows, f"Relative change of {what} per damage of each zone [%]"))
        return tables

    @property
    def _strain_changes(self) -> Any:  # noqa: ANN401
        """What the sensor that changes most changes, over the largest reading of all, by mode and zone [1]."""
        import numpy as np

        changes, read = self.changes.strain, np.abs(self.result.strain).max(axis=1, initial=0.0)
        if not changes.shape[1]:
            return []
        most = np.take_along_axis(changes, np.abs(np.nan_to_num(changes)).argmax(axis=1)[:, None], axis=1)[:, 0]
        seen = read > 1e-9 * np.linalg.norm(self.result.shapes, axis=2).max() / self.result.linearised.structure.mesh.size
        return np.where(seen[:, None], most / np.maximum(read, 1e-300)[:, None], np.nan)

    def describe(self) -> Page:
        """Return the page: shapes in motion, tables."""
        from .pages.modes import modes_page

        title = self.result.linearised.structure.setup.title or "A membrane"
        return modes_page(f"Modes: {title}", self.result, self.changes, self.sentence, self.tables())

    def to_json(self) -> dict[str, Any]:
        """Return all but the shapes."""
        found, names = self.result, self.result.linearised.structure.zone_names
        return {
            "files": self.files,
            "zones": names,
            "modes": [
                {"frequency_Hz": f, "damping_ratio": ratio, "effective_mass": mass, "change_per_damage": change}
                for f, ratio, mass, change in zip(
                    found.frequencies, found.damping_ratios, found.effective_masses, self.changes.frequency, strict=True
                )
            ],
            "units": {"effective_mass": ["kg"] * 3 + ["kg m2"] * 3},
        }


@command
def modes(
    setup: File | None = None,
    *,
    mesh: File | None = None,
    count: Count = 10,
    set: Values | None = None,
    out: Folder = "out/modes",
) -> MembraneModes:
    """Find the frequencies and shapes of a membrane about its equilibrium.

    Tells what damage of each zone does to them: what a modal test can see. Writes modes.nc (all arrays), modes.vtu (shapes
    for ParaView), and report.html, the page with the shapes in motion.

    Parameters
    ----------
    setup
        The setup of a membrane on a mesh, or sail, drum, reflector, tube, which ship with Gossamer; or the folder of a run,
        for its membrane as the scenario starts it; by default the square membrane of the thesis.
    mesh
        Mesh file in place of the setup's own.
    count
        How many modes, the slowest first.
    set
        A parameter or input of the membrane, for instance pressure=100 or damage[3]=0.2; may be repeated.
    out
        Folder to write.

    Returns
    -------
    MembraneModes
        Frequencies, shapes, effective masses, and their changes by damage; displayed in a notebook.

    Examples
    --------
    >>> gossamer.modes("drum", count=6).data["frequency"]

    On the command line::

        gossamer modes drum

        gossamer modes --set damage[6]=0.3 --count 20

        gossamer modes sail --set pressure=0.1 --out out/sail_modes
    """
    from gossamer_files import replacing
    from gossamer_models.membrane import Linearised
    from gossamer_orchestrator.errors import ResultsError, writing
    from gossamer_orchestrator.results.vtk import write_surface

    from .pages.space import surface_of

    folder = Path(out)
    arrays, shapes = folder / "modes.nc", folder / "modes.vtu"
    check_outputs([arrays, shapes])
    structure, given = _membrane(setup, mesh, set)
    found = Linearised(structure, given).modes(count)
    changes = found.sensitivities()
    with writing(arrays, ResultsError), replacing(arrays) as new:
        MembraneModes(files=[], result=found, changes=changes).data.to_netcdf(new, engine="scipy")
    surface, still = surface_of(structure), found.linearised.displacement
    named = {
        f"mode {k + 1}, {f:.5g} Hz": shape for k, (f, shape) in enumerate(zip(found.frequencies, found.shapes, strict=True))
    }
    files = [arrays]
    try:
        write_surface(shapes, surface, surface.nodes + still, named, {})
        files.append(shapes)
    except ResultsError as error:
        say(str(error))
    pages = save_page(MembraneModes(files=files, result=found, changes=changes).describe, folder)
    return MembraneModes(files=[*files, *pages], result=found, changes=changes)


@dataclass(frozen=True, kw_only=True, repr=False)
class ReducedMembrane(Saved):
    """A membrane that was reduced to modes.

    Attributes
    ----------
    files : list of Path
        FMU, arrays for NumPy and MATLAB, and page.
    result : gossamer_models.membrane.Reduced
        The reduced model.
    reaches : list of gossamer_models.membrane.Reach
        How far each load may go.
    frame : bool
        Whether the FMU rides on a frame that flies.
    """

    result: Reduced
    reaches: Sequence[Reach]
    frame: bool

    @property
    def data(self) -> xr.Dataset:
        """``A``, ``B``, ``C``, ``D`` by ``state``, ``input`` and ``output``, which have their names, with ``input_unit`` and
        ``output_unit``; ``M``, ``damping`` and ``K`` by ``coordinate``, six motions of the frame and the modes; by ``mode``
        ``frequency`` [Hz], ``participation`` [kg^1/2], [kg^1/2 m] and ``shape``; ``softening`` [1/s2] by ``zone``;
        ``strain_bending``, second derivatives of the strains by ``bent`` and ``bent_too``; by ``spring`` the modes as masses
        on springs, ``spring_mass`` [kg] and so on, see ``gossamer_models.membrane.SpringMasses``.
        """  # noqa: D205
        import xarray as xr
        from gossamer_models.membrane import spring_masses
        from gossamer_models.membrane.vibration import AXES

        found, modes, known = self.result, self.result.modes, self.result.modes.linearised
        n = len(modes.squares)
        shown = found.outputs[: found.n_y]
        forces = [(f"{part}[{k}]", unit) for part, unit in (("force", "N"), ("torque", "N m")) for k in (1, 2, 3)]
        outputs = [*((v.name, v.unit) for v in shown), *forces]
        kept = [f"mode[{k}]" for k in range(1, n + 1)]
        dims = {"A": ("state", "state_too"), "B": ("state", "input"), "C": ("output", "state"), "D": ("output", "input")}
        dims |= dict.fromkeys(("M", "damping", "K"), ("coordinate", "coordinate_too"))
        values: dict[str, Any] = {name: (dims[name], each) for name, each in found.matrices().items()}
        values |= {
            "input_unit": ("input", [v.unit for v in found.inputs]),
            "output_unit": ("output", [unit for _, unit in outputs]),
            "frequency": ("mode", modes.frequencies, {"units": "Hz"}),
            "participation": (("mode", "axis"), modes.participation),
            "shape": (("mode", "node", "direction"), modes.shapes, {"units": "kg^-1/2"}),
            "equilibrium": (("node", "direction"), known.displacement, {"units": "m"}),
            "softening": (("zone", "mode", "mode_too"), found.softening, {"units": "1/s2"}),
            "strain_bending": (("sensor", "bent", "bent_too"), found.H),
            "start": ("output", [*found.start[: found.n_y], *(found.start[-12:-6] + found.start[-6:])]),
        }
        springs = spring_masses(found)
        for name in springs.__slots__:
            each = getattr(springs, name)
            values[f"spring_{name}"] = (("spring", "direction")[: each.ndim], each)
        states = [*kept, *(f"der(mode[{k}])" for k in range(1, n + 1))]
        coords: dict[str, Any] = {
            "state": states,
            "input": [v.name for v in found.inputs],
            "output": [name for name, _ in outputs],
            "coordinate": [*AXES, *kept],
            "axis": list(AXES),
            "bent": [*kept, *(found.inputs[k].name for k in found.bending)],
            "direction": list("xyz"),
        }
        return xr.Dataset(values, coords)

    @property
    def sentence(self) -> str:
        """How many modes it has, and how far they reach."""
        f = self.result.modes.frequencies
        return f"{len(f)} modes from {f[0]:.5g} to {f[-1]:.5g} Hz; inputs should be slower than the last of them."

    def lines(self) -> list[str]:
        """Return what they are."""
        return [self.sentence]

    def tables(self) -> list[TableText]:
        """Return how far each load may go until the model is wrong by 5 %."""
        rows = []
        for each in self.reaches:
            if not each.compared:
                continue
            cells = [_reached(*each.displacement, " m", each.compared), _reached(*each.strain, "", each.compared)]
            rows.append((f"{each.load.name} [{each.load.unit}]", *cells))
        head = ("load", "displacement wrong by 5 %", "strain wrong by 5 %")
        caption = "Change of a load at which the reduced model is wrong by 5 % at rest, measured against the full membrane"
        return [TableText(head, rows, caption)]

    def describe(self) -> Page:
        """Return the page: the modes in motion, and how far the model reaches."""
        from .pages.modes import modes_page

        title = self.result.modes.linearised.structure.setup.title or "A membrane"
        return modes_page(f"Reduced: {title}", self.result.modes, None, self.sentence, self.tables())

    def to_json(self) -> dict[str, Any]:
        """Return names, frequencies and how far each load may go."""
        found = self.result
        return {
            "files": self.files,
            "frequency_Hz": found.modes.frequencies,
            "inputs": {v.name: v.unit for v in found.inputs},
            "outputs": {v.name: v.unit for v in found.outputs[: found.n_y]},
            "wrong_by_5_percent": [
                {"load": each.load.name, "displacement": each.displacement, "strain": each.strain, "compared": each.compared}
                for each in self.reaches
            ],
        }


@command
def reduce(
    setup: File | None = None,
    *,
    mesh: File | None = None,
    modes: Count = 20,
    nodes: Numbers | None = None,
    set: Values | None = None,
    frame: bool = False,
    native: bool = False,
    platform: Names | None = None,
    fmi: FmiVersion = 2,
    out: Folder = "out/reduced",
) -> ReducedMembrane:
    """Reduce a membrane to a small linear model about its equilibrium, for control and attitude.

    Writes an FMU, the matrices as reduced.npz (NumPy) and reduced.mat (MATLAB), with the modes as masses on springs for
    Basilisk, flex_42.txt and nodes_42.txt for the simulator 42, and report.html, which states from which load on the model
    is wrong by 5 %.

    Parameters
    ----------
    setup
        The setup of a membrane on a mesh, or sail, drum, reflector, tube, which ship with Gossamer; or the folder of a run,
        for its membrane as the scenario starts it; by default the square membrane of the thesis.
    mesh
        Mesh file in place of the setup's own.
    modes
        How many modes, the slowest first.
    nodes
        Nodes of the mesh, from 1, whose displacements are outputs, with commas; by default the one that the slowest mode
        moves most.
    set
        A parameter or input of the membrane, for instance pressure=100 or damage[3]=0.2; may be repeated.
    frame
        Put it on a frame that flies: the FMU takes the place of framed_membrane.
    native
        Compile C code, so that the FMU runs without Python.
    platform
        Of native FMUs: linux64, win64, darwin64, aarch64-linux (FMI 3 only) or all; may be repeated; this machine's
        platform by default.
    fmi
        Of native FMUs: version of the standard, 2 or 3.
    out
        Folder to write.

    Returns
    -------
    ReducedMembrane
        Its matrices and how far it reaches; displayed in a notebook.

    Examples
    --------
    >>> gossamer.reduce("tube", modes=12).data["A"]

    On the command line::

        gossamer reduce tube --modes 12

        gossamer reduce sail --frame --native --set sun=0

        gossamer reduce --nodes 145,37 --out out/mine
    """
    from gossamer_files import write_text
    from gossamer_fmus import build_models, fmu_folder
    from gossamer_models.membrane import Linearised, flex_file, node_file, reaches, reduce_membrane, reduced_model
    from gossamer_orchestrator.errors import ResultsError, writing

    folder = Path(out)
    arrays, matlab = folder / "reduced.npz", folder / "reduced.mat"
    texts = {folder / "flex_42.txt": flex_file, folder / "nodes_42.txt": node_file}
    check_outputs([arrays, matlab, *texts, folder / "reduced_membrane.fmu"])
    kept = Linearised(*_membrane(setup, mesh, set)).modes(modes)
    found = reduce_membrane(kept, [int(k) for k in nodes or ()])
    model = reduced_model(found, frame=frame)
    result = ReducedMembrane(files=[], result=found, reaches=reaches(found), frame=frame)
    readme = fmu_folder("membrane") / "reduced.md"
    built = build_models(
        {model.name: model}, folder, readme, native=native, fmi=fmi, platforms=tuple(several(platform)), progress=say
    )
    values = {str(name): each.to_numpy() for name, each in result.data.variables.items()}
    _save(arrays, matlab, values)
    title = found.modes.linearised.structure.setup.title or "Membrane"
    for path, text_of in texts.items():
        with writing(path, ResultsError):
            write_text(path, text_of(found, title))
    files = [*built.values(), arrays, matlab, *texts]
    pages = save_page(result.describe, folder)
    return ReducedMembrane(files=[*files, *pages], result=found, reaches=result.reaches, frame=frame)


def _reached(at: float, change: float, unit: str, compared: float) -> str:
    return f"{number(at)} ({number(change)}{unit})" if at == at else f"above {number(compared)}"


def _save(arrays: Path, matlab: Path, values: dict[str, Any]) -> None:
    """Write arrays by name; names in them are text for NumPy and cells for MATLAB."""
    import numpy as np
    from gossamer_files import replacing
    from gossamer_orchestrator.errors import ResultsError, writing
    from scipy.io import savemat

    with writing(arrays, ResultsError), replacing(arrays) as new, new.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **values)
    cells = {name: each.astype(object) if each.dtype.kind in "UO" else each for name, each in values.items()}
    with writing(matlab, ResultsError), replacing(matlab) as new, new.open("wb") as file:
        savemat(file, cells, do_compression=True)


def _membrane(setup: File | None, mesh: File | None, values: Values | None) -> tuple[Structure, dict[str, float]]:
    """Return a membrane, and parameters and inputs of it that differ from their start values."""
    from gossamer_models.membrane import square_structure
    from gossamer_orchestrator.results import dataset, files

    from .descriptions import load_structure

    given = numbers_by_name(assigned(values), "for instance pressure=100")
    if setup is None:
        need_setup(mesh=mesh)
        return square_structure(), given
    if mesh is not None or not any((Path(setup) / name).is_file() for name in files.RECORDED):
        return load_structure(setup, mesh), given
    data = files.load_results(Path(setup))
    membrane = dataset.find(data, "membrane")
    structure = structure_in(data, membrane)
    known = {v.name for v in structure.table}
    stated = dataset.parameters_of(data, membrane) | dataset.parameters_of(data, membrane, "start")
    return structure, {name: value for name, value in stated.items() if name in known} | given
