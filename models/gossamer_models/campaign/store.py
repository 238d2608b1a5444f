"""The Zarr store of a campaign: one file per chunk and variable, so that a worker owns what it writes.

A chunk is finished when its file of ``finished`` is there, which is written last; Zarr writes a file under another name and
renames it. So whatever kills a worker leaves a chunk that is finished or one that is run again. Histories are single
precision: half the size of double (10,000 cases of 0.3 s: 160 MB), and their rounding, 6e-8, is far below any noise.
"""

from __future__ import annotations

import hashlib
import json
import platform
import shutil
import uuid
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..compensator.estimator import HALF_WIDTHS
from ..errors import DataError
from ..membrane.portable import structure_text
from .chunk import Kernels
from .description import LOAD, NOISE, ONSET, SENSOR_ERROR, SENSOR_GAIN, CampaignPlan
from .symmetry import find_symmetry

if TYPE_CHECKING:
    import xarray as xr
    import zarr

SCHEMA, VERSION = "gossamer.campaign", 2
HISTORY = ("case", "sensor", "time")


def identity(campaign: CampaignPlan, kernels: Kernels) -> dict[str, Any]:
    """Return everything that the numbers of a campaign depend on, as JSON values by the path of their keys."""
    content = asdict(campaign)
    del content["title"], content["coarser"]
    if campaign.chain is not None:
        del content["chain"]["artifact"]  # the digest of the sensor stands for it
    if campaign.membrane.setup is not None:
        del content["membrane"]["setup"]["mesh"]  # and that of the membrane for its mesh
    del content["membrane"]["carried"]
    for name in ("load", "finer"):
        if not content["membrane"][name]:
            del content["membrane"][name]
    models = {f"model.{name}": digest for name, digest in kernels.digests.items()}
    engine = "compiled" if kernels.membrane.compiled else "stepper"  # they differ by round-off
    return {"gossamer": version("gossamer"), "kernels": engine, **models, **dict(_flat(json.loads(json.dumps(content)), ""))}


def _flat(content: Any, path: str) -> list[tuple[str, Any]]:  # noqa: ANN401
    if isinstance(content, dict) and content:
        return [item for key, value in sorted(content.items()) for item in _flat(value, f"{path}.{key}".lstrip("."))]
    return [(path, content)]


def open_store(path: Path, campaign: CampaignPlan, kernels: Kernels) -> zarr.Group:
    """Open the store of a campaign to write its chunks.

    Parameters
    ----------
    path : Path
        Folder.
    campaign : CampaignPlan
        What is run.
    kernels : Kernels
        Its models.

    Raises
    ------
    DataError
        It is the store of another campaign or version, or something else.
    """
    group = _open(path, "r+")
    wanted = identity(campaign, kernels)
    there: dict[str, Any] = json.loads(json.dumps(group.attrs["identity"]))
    if there != wanted:
        keys = [key for key in {**there, **wanted} if there.get(key) != wanted.get(key)]
        lines = "".join(f"\n  {key}: {_short(there.get(key))} there, {_short(wanted.get(key))} here" for key in keys)
        msg = f"{path} holds another campaign:{lines}\nName another folder with {option('out')}, or delete it."
        raise DataError(msg)
    return group


def _short(value: Any) -> str:  # noqa: ANN401
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:12]}..."


def _open(path: Path, mode: Any) -> zarr.Group:  # noqa: ANN401
    import zarr

    try:
        group = zarr.open_group(path, mode=mode, zarr_format=3)
        schema, number, *_ = (group.attrs[name] for name in ("schema", "version", "identity", "campaign", "sha256"))
        group["finished"]
    except (FileNotFoundError, FileExistsError, KeyError, TypeError, ValueError) as error:
        msg = f"{path} is not the store of a campaign. Name its folder, or another one for a new campaign."
        raise DataError(msg) from error
    if (schema, number) != (SCHEMA, VERSION):
        advice = "Run the campaign again with this version of Gossamer, into another folder."
        msg = f"{path} holds {schema!r} version {number!r}; this program reads {SCHEMA!r} version {VERSION}. {advice}"
        raise DataError(msg)
    return group


def create_store(path: Path, campaign: CampaignPlan, kernels: Kernels, source: str = "") -> None:
    """Create the store of a campaign beside its place and move it there once it is whole.

    Parameters
    ----------
    path : Path
        Folder; there is nothing yet.
    campaign : CampaignPlan
        What will be run.
    kernels : Kernels
        Its models.
    source : str
        The file that the campaign was read from; kept as it is.

    Raises
    ------
    OSError
        The folder cannot be written.
    """
    import zarr

    path.parent.mkdir(parents=True, exist_ok=True)
    wanted = identity(campaign, kernels)
    unfinished = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    attributes: dict[str, Any] = {
        "schema": SCHEMA,
        "version": VERSION,
        "title": campaign.title,
        "campaign": json.dumps(asdict(campaign)),
        "campaign.toml": source,
        "identity": wanted,
        "symmetry": json.dumps(find_symmetry(campaign, kernels).lists()),
        "sha256": hashlib.sha256(json.dumps(wanted, sort_keys=True).encode()).hexdigest(),
        "versions": {"python": platform.python_version(), **{name: version(name) for name in ("numpy", "casadi", "zarr")}},
    }
    structure = campaign.membrane.structure
    if campaign.membrane.setup is not None:
        attributes["structure"] = structure_text(structure)
    sizes = {"case": campaign.count, "sensor": structure.n_sensors, "zone": structure.n_zones, "time": campaign.steps}
    try:
        group = zarr.create_group(unfinished, attributes=attributes)
        for name, (dims, dtype, unit, description) in _variables(campaign).items():
            array = group.create_array(
                name,
                shape=tuple(sizes[d] for d in dims),
                chunks=tuple(campaign.chunk if d == "case" and name != d else sizes[d] for d in dims),
                dtype=dtype,
                fill_value=np.nan if np.dtype(dtype).kind == "f" else 0,
                dimension_names=dims,
                attributes={"units": unit, "long_name": description},
            )
            if name in sizes:
                first = 0 if name == "case" else 1
                steps = np.arange(first, first + sizes[name])
                array[:] = steps * campaign.step if name == "time" else steps
            if name == "zone":
                array.attrs["names"] = list(structure.zone_names)
            if name == "resistance" and kernels.chain is not None:
                array.attrs["full_scale_change"] = kernels.chain.full_scale_change
            if name == "compensated_strain" and campaign.chain is not None:
                late = HALF_WIDTHS[-1] if campaign.chain.compensator == "estimator" else 0
                array.attrs["delay"] = late * campaign.step  # [s]
        unfinished.rename(path)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _variables(campaign: CampaignPlan) -> dict[str, tuple[tuple[str, ...], str, str, str]]:
    """List the variables of the store: dimensions, type, unit, description."""
    settable = campaign.membrane.settable
    varied: dict[str, tuple[tuple[str, ...], str, str, str]] = {
        name: (("case",), "f8", settable[name].unit, settable[name].description)
        for name in sorted(campaign.vary)
        if name in settable
    }
    for name, what in ((NOISE, "noise"), (LOAD, "loads")):
        if name in campaign.vary:
            varied[name] = (("case",), "f8", "1", f"Factor on the {what}")
    if SENSOR_ERROR in campaign.vary:
        what = "Root mean square of the error of a sensor over the range of what it feels"
        varied[SENSOR_ERROR] = (("case", "sensor"), "f8", "1", what)
    if campaign.begins:
        varied[ONSET] = (("case",), "f8", "s", "When damage begins; 0: it is there from the start")
    if campaign.membrane.finer:
        varied["finer"] = (("case",), "bool", "1", "Whether it runs on finer elements")
    histories = {"strain": (HISTORY, "f4", "1", "Strain of the membrane at its sensors, prestrain included, without noise")}
    if campaign.chain is not None:
        histories["resistance"] = (HISTORY, "f4", "ohm", "Resistance without noise")
        histories["compensated_strain"] = (HISTORY, "f4", "1", "Strain from the compensators, given resistance with noise")
    return {
        "case": (("case",), "i8", "1", "Number of the case"),
        "sensor": (("sensor",), "i8", "1", "Sensor"),
        "zone": (("zone",), "i8", "1", "Damage zone"),
        "time": (("time",), "f8", "s", "Time since the load began"),
        "damage": (("case", "zone"), "f8", "1", "Lost fraction of Young's modulus"),
        SENSOR_GAIN: (("case", "sensor"), "f8", "1", "Ratio of a sensor's reading to the right one"),
        **varied,
        **histories,
        "failed": (("case",), "bool", "1", "Whether the simulation broke; its histories are not a number"),
        "finished": (("case",), "bool", "1", "Whether the case has been run"),
    }


def write_cases(group: zarr.Group, cases: range, content: Mapping[str, NDArray[np.generic]]) -> None:
    """Write the cases of one chunk, and last that they are finished."""
    where = slice(cases.start, cases.stop)
    for name, values in content.items():
        _array(group, name)[where] = values
    _array(group, "finished")[where] = True


def missing_chunks(group: zarr.Group, campaign: CampaignPlan) -> list[int]:
    """Return the numbers of the chunks that are not finished."""
    finished = np.asarray(_array(group, "finished")[:], dtype=bool)
    return [chunk for chunk in range(campaign.chunks) if not finished[campaign.numbers(chunk).start]]


def count_failed(group: zarr.Group) -> int:
    """Count the cases whose simulation broke."""
    return int(np.count_nonzero(_array(group, "failed")[:]))


def remove_leftovers(path: Path) -> None:
    """Remove what killed workers had begun to write."""
    for file in path.rglob("*.partial"):
        with suppress(OSError):
            file.unlink()


def _array(group: zarr.Group, name: str) -> Any:  # noqa: ANN401
    return group[name]


def read_campaign(path: Path) -> xr.Dataset:
    """Read a campaign, or as much of it as has been run.

    Parameters
    ----------
    path : Path
        Folder that ``gossamer campaign`` printed.

    Returns
    -------
    xarray.Dataset
        Dimensions case, sensor, time and zone; the finished cases only. Arrays are read when they are used.

    Raises
    ------
    DataError
        There is no campaign, or one of another version.
    """
    import xarray as xr

    _open(Path(path), "r")
    data: xr.Dataset = xr.open_zarr(path, consolidated=False, chunks=None)
    finished = data["finished"].to_numpy()
    data = data.drop_vars("finished")
    return data if finished.all() else data.isel(case=np.flatnonzero(finished))
