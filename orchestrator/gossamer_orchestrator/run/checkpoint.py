"""The state of a run at a communication point, on the disk: what ``gossamer run --resume`` continues from.

An NPZ file: the serialized state of every FMU, the values that were exchanged last, the last sample that arrived over each
channel, the largest values of each group, and a JSON card. Noise and dropouts are functions of their seeds and the step,
events of the time, so nothing of them is kept.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np
from gossamer_files import digest, replacing

from ..errors import ResultsError, ScenarioError, writing
from ..scenario.plan import Plan
from .steps import StepControl

if TYPE_CHECKING:
    from .master import Simulation

SCHEMA, VERSION = "gossamer.checkpoint", 1


def digests(plan: Plan) -> dict[str, str]:
    """Return a digest of the scenario and of every FMU and file of inputs, by what they are called in a message."""
    scenario = plan.scenario
    found = {"the scenario": hashlib.sha256((scenario.source.text + scenario.model_dump_json()).encode()).hexdigest()}
    paths = {f"FMU {file.name!r}": file.path for file in plan.files}
    paths |= {f"file {given.file!r}": scenario.folder / given.file for given in scenario.inputs}
    for name, path in paths.items():
        found[name] = digest(path)
    return found


def unable(plan: Plan) -> list[str]:
    """List the FMUs whose runs cannot be resumed: they cannot serialize their state, or have events of their own."""
    return [
        file.name
        for file in plan.files
        if not file.interface.canSerializeFMUstate
        or file.model_exchange  # its state does not include its next event
        or getattr(file.interface, "hasEventMode", False)
    ]


def save(path: Path, simulation: Simulation, rows: int, digest: dict[str, str]) -> None:
    """Write the present state of a run of which ``rows`` rows are on the disk; raise ``ResultsError`` if it cannot."""
    card = {
        "schema": SCHEMA,
        "version": VERSION,
        "digest": digest,
        "tick": simulation.tick,
        "rows": rows,
        "divided": simulation.divided,
        "exact": [value.hex() if isinstance(value, bytes) else value for value in simulation.store.exact],
    }
    arrays: dict[str, Any] = {"card": np.array(json.dumps(card)), "values": simulation.values}
    arrays["held"] = np.array([channel.held for channel in simulation.channels])
    if isinstance(simulation.control, StepControl):
        arrays |= {"size": np.array(simulation.control.size), "peaks": simulation.control.peaks}
    arrays |= {f"peaks_{i}": group.peaks for i, group in enumerate(simulation.groups)}
    arrays |= {f"state_{i}": np.frombuffer(state, np.uint8) for i, state in enumerate(simulation.serialize())}
    with writing(path, ResultsError), replacing(path) as new, new.open("wb") as file:
        np.savez(file, **arrays)


def load(path: Path, plan: Plan) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the card and the arrays of the unfinished run of a plan.

    Raises
    ------
    ResultsError
        There is no unfinished run, or it cannot be read.
    ScenarioError
        An FMU cannot serialize its state, or the unfinished run had another scenario or other FMUs.
    """
    if names := unable(plan):
        msg = (
            f"{', '.join(names)} cannot serialize {'its' if len(names) == 1 else 'their'} state (canSerializeFMUstate), or "
            "has events of its own (event mode, model exchange), so this run cannot be resumed. Run it from its start, "
            "without --resume."
        )
        raise ScenarioError(msg)
    if not path.is_file():
        msg = f"there is no unfinished run in {path.parent} to resume. Run it from its start, without --resume."
        raise ResultsError(msg)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
        card: dict[str, Any] = json.loads(str(arrays.pop("card")))
        known = (card["schema"], card["version"])
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        msg = f"cannot read {path}: {error}. Run it from its start, without --resume."
        raise ResultsError(msg) from error
    if known != (SCHEMA, VERSION):
        msg = f"{path} holds {known[0]!r} version {known[1]}, this program reads {SCHEMA!r} version {VERSION}."
        raise ResultsError(msg)
    present, earlier = digests(plan), card["digest"]
    changed = [name for name in present | earlier if present.get(name) != earlier.get(name)]
    if changed:
        msg = (
            f"{', '.join(changed)} differ{'s' * (len(changed) == 1)} from the unfinished run in {path.parent}. "
            "Give it what it had, also --step, --stop, --set and --master, or run it from its start, without --resume."
        )
        raise ScenarioError(msg)
    return card, arrays


def restore(simulation: Simulation, card: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Bring a simulation that has just started to the state of ``load``."""
    for tick in sorted(simulation.plan.events):
        for name, values in simulation.plan.events[tick] if 0 < tick < card["tick"] else ():
            simulation.member(name).set(values)  # arrays keep the elements that nothing feeds
    simulation.deserialize([arrays[f"state_{i}"].tobytes() for i in range(len(simulation.members))])
    simulation.values[:] = arrays["values"]
    simulation.store.exact[:] = [
        bytes.fromhex(value) if isinstance(old, bytes) else value
        for value, old in zip(card["exact"], simulation.store.exact, strict=True)
    ]
    for channel, value in zip(simulation.channels, arrays["held"].tolist(), strict=True):
        channel.held = value
    for i, group in enumerate(simulation.groups):
        group.peaks[:] = arrays[f"peaks_{i}"]
    if isinstance(simulation.control, StepControl):
        simulation.control.size = int(arrays["size"])
        simulation.control.peaks = arrays["peaks"]
    simulation.tick, simulation.divided = card["tick"], card["divided"]
