"""Read a TOML file into a dataclass of the models: keys and types are those of the class, mistakes have lines."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from gossamer_files.inputs import followed
from gossamer_files.options import option
from gossamer_models import campaign
from gossamer_models.campaign import CampaignPlan
from gossamer_models.membrane import Setup, Structure, as_built, make_structure, read_mesh, surface_mesh, taken
from gossamer_models.membrane.portable import TABLES
from gossamer_models.mistakes import DescriptionError, raise_any
from gossamer_models.twin import read_loads
from gossamer_orchestrator import ScenarioError
from gossamer_orchestrator.names import suggest
from gossamer_orchestrator.scenario.schema import ScenarioTable
from gossamer_orchestrator.scenario.source import Location, Problems, Source, explain, find_scenario, parse_toml, read_text
from pydantic import ValidationError, create_model

from .arguments import AnyPath

T = TypeVar("T")

VECTORS = ("prestress", "direction", "displacement", "stretch", "centre", "point", "axis")  # arrays of three numbers
USUAL = {"youngs_modulus": (1e3, 1e13, "Pa"), "density": (1.0, 3e4, "kg/m3"), "thickness": (1e-8, 0.1, "m")}  # of a region
OF_A_CAMPAIGN: dict[str, type] = {
    "membrane": campaign.Mesh,
    "damage": campaign.Damage,
    "vary": campaign.Vary,
    "noise": campaign.MeasurementNoise,
    "strain": campaign.Distribution,
    "resistance": campaign.Distribution,
    "chain": campaign.Chain,
    "coarser": campaign.Coarser,
}

logger = logging.getLogger(__name__)


def read_description(
    path: Path,
    what: str,
    kind: type[T],
    tables: Mapping[str, type],
    complete: Callable[[dict[str, Any]], None] | None = None,
) -> tuple[T, Source]:
    """Read and check a file.

    Parameters
    ----------
    path : Path
        A TOML file.
    what : str
        What it should be, for messages.
    kind : type
        The dataclass; its file holds the keys at the top.
    tables : mapping of str to type
        Dataclasses by the names of the tables in it, for suggestions.
    complete : callable, optional
        Puts what other files hold in the place of their names.

    Returns
    -------
    T
        The content.
    Source
        The text.

    Raises
    ------
    ScenarioError
        The file cannot be read, is not TOML, or has unknown, missing or meaningless keys; one line per mistake.
    """
    source = Source(path.name, read_text(path, what))
    content = parse_toml(source.text, source.name, what)
    if complete is not None:
        complete(content)
    problems = Problems(source)
    file: Any = create_model("File", __base__=ScenarioTable, content=(kind, ...))
    try:  # as JSON, so that arrays are tuples and tables are what they are for, while types stay strict
        found: T = file.model_validate_json(json.dumps({"content": content}, default=str)).content
    except ValidationError as error:
        for item in error.errors():
            place = item["loc"][1:]
            cause = item.get("ctx", {}).get("error")
            if isinstance(cause, DescriptionError):
                _note(cause, problems, place)
            elif item["type"] == "too_long" or (item["type"] == "missing" and place and isinstance(place[-1], int)):
                array = place if item["type"] == "too_long" else place[:-1]
                problems.add(array, f"{array[-1]!r} needs {_shape(item, place)}.")
            else:
                problems.add(place, explain(item["type"], place, item["msg"], item["input"], _known(place, kind, tables)))
        problems.raise_if_any()
        raise
    return found, source


@contextmanager
def locating(source: Source) -> Iterator[None]:
    """Give the mistakes of a description that show inside the ``with`` block the lines of its file."""
    try:
        yield
    except DescriptionError as error:
        problems = Problems(source)
        _note(error, problems)
        problems.raise_if_any()


def load_campaign(path: Path) -> tuple[CampaignPlan, Source]:
    """Read and check a campaign file, see ``read_description``; the files that it names are relative to its folder."""

    def complete(content: dict[str, Any]) -> None:
        table = content.get("membrane")
        if not isinstance(table, dict):
            return
        setup = None
        if isinstance(name := table.get("setup"), str):
            beside = path.parent / name
            setup = setup_of(beside if beside.is_file() else name)
            table["setup"] = asdict(setup)
        if isinstance(name := table.get("load"), str):
            table["load"] = asdict(read_loads(path.parent / name, campaign.Mesh(setup=setup).structure))

    found, source = read_description(path, "campaign", CampaignPlan, OF_A_CAMPAIGN, complete)
    if found.chain is not None and found.chain.artifact is not None:
        found = replace(found, chain=replace(found.chain, artifact=str(followed(path.parent / found.chain.artifact))))
    return found, source


def setup_of(setup: AnyPath, mesh: AnyPath | None = None) -> Setup:
    """Read and check a setup, see ``load_structure``; its ``mesh`` is the whole path of the file."""
    path = find_scenario(str(setup), "membrane")
    found = load_structure(path, mesh).setup
    return replace(found, mesh=str(followed(mesh or path.parent / found.mesh)))


def load_structure(setup: AnyPath, mesh: AnyPath | None = None, *, expose: bool = False) -> Structure:
    """Read and check a setup and its mesh; warn of numbers that no membrane has, as from a wrong unit.

    Parameters
    ----------
    setup : path
        A TOML file, or the name of one that is shipped.
    mesh : path, optional
        Mesh file, in place of the setup's own.
    expose : bool
        Whether the displacement of every node is a variable, whatever the setup says.

    Returns
    -------
    Structure

    Raises
    ------
    ScenarioError
        The setup has mistakes, in itself or on this mesh; one line per mistake.
    DataError
        The mesh cannot be used.
    """
    path = find_scenario(str(setup), "membrane")
    found, source = read_description(path, "setup", Setup, TABLES)
    if mesh is None and not found.mesh:
        msg = f'{path.name} names no mesh. Write mesh = "sail.msh" at its top, or name the file with {option("mesh")}.'
        raise ScenarioError(msg)
    _warn_of_units(found, source)
    found = replace(found, expose=expose or found.expose)
    with locating(source):
        file = Path(mesh or path.parent / found.mesh)
        drawn = surface_mesh(read_mesh(file, found.scale), found.order)
        raise_any([*taken({"beams": found.beams, "cables": found.cables}, drawn)])
        return make_structure(found, drawn if found.built is None else as_built(drawn, found.built))


def _warn_of_units(setup: Setup, source: Source) -> None:
    """Warn of materials that are allowed, and so far from any known one that a unit is probably wrong."""
    for i, region in enumerate(setup.regions):
        for name, (low, high, unit) in USUAL.items():
            if not low <= (value := getattr(region, name)) <= high:
                where = source.where(("regions", i, name))
                text = "%s: %r is %g %s; that of a membrane is %g to %g %s. Is it in another unit?"
                logger.warning(text, where, name, value, unit, low, high, unit)


def _note(error: DescriptionError, problems: Problems, place: Location = ()) -> None:
    for mistake in error.mistakes:
        advice = f" {suggest(mistake.name, mistake.known)}" if mistake.known else ""
        problems.add((*place, *mistake.place), mistake.text + advice)


def _shape(item: Any, place: Location) -> str:  # noqa: ANN401
    """Say how many numbers an array needs: pydantic knows it of one that is too long, and the first that one lacks."""
    size = item["ctx"]["max_length"] if item["type"] == "too_long" else None
    if size == 2 or (size is None and place[-1] in (0, 1) and place[-2] not in VECTORS):
        return "two numbers, [low, high]"
    return "three numbers"


def _known(location: Location, kind: type, tables: Mapping[str, type]) -> list[str]:
    """List the keys of the table around a location."""
    owner = next((tables[part] for part in reversed(location[:-1]) if part in tables), kind)  # type: ignore[index]
    return [field.name for field in fields(owner)]
