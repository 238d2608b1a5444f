"""A compensator or detector as C for a flight processor, and what it needs there."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from gossamer_files import replacing_all, uninterrupted, write_text
from gossamer_files.options import option
from gossamer_files.tables import TableText
from gossamer_orchestrator.errors import require

from .arguments import AnyPath, File, Folder, NotNegative, Scales, command
from .results import Saved
from .working import progress_bar

if TYPE_CHECKING:
    from gossamer_models import StepModel
    from gossamer_models.arrays import Vector

DEFAULT_NOISE = 1e-3  # of strain [1]

_ROWS = (  # key, words, unit
    ("text", "code", "byte"),
    ("rodata", "constants", "byte"),
    ("ram", "RAM of a component: its state, twice", "byte"),
    ("work", "RAM of work space, which components share", "byte"),
    ("stack", "stack bound along the call graph, without the C library", "byte"),
    ("stack_in_use", "stack in use, with the C library and the runner's printf", "byte"),
    ("most", "instructions of a step, the most (a count, not a time)", "1"),
    ("random", "the same in random states: any inputs, samples missing, a copy to heal", "1"),
    ("mean", "instructions of a step, on average", "1"),
    ("worst", "error of the golden vectors, over the largest of each result", "1"),
)


@dataclass(frozen=True, kw_only=True, repr=False)
class FlightCode(Saved):
    """A component for a flight processor.

    Attributes
    ----------
    files : sequence of Path
        The folder of its sources; the FMU with the processor in the loop, if that was wanted.
    kind : str
        What it is.
    bits : int
        Of its numbers.
    budgets : dict of str to float
        What it needs on a Cortex-M7, by name; empty where that was not measured.
    """

    kind: str
    bits: int
    budgets: dict[str, float]

    @property
    def sentence(self) -> str:
        """What it is."""
        return f"The {self.kind} as C, in numbers of {self.bits} bits, without allocation and global state."

    def tables(self) -> list[TableText]:
        """Return the budgets."""
        rows = [(words, f"{self.budgets[key]:.6g}", unit) for key, words, unit in _ROWS if self.budgets]
        return [TableText(("on a Cortex-M7 under QEMU", "", "unit"), rows, "")]

    def hints(self) -> list[str]:
        """Return what to type next."""
        loop = [
            f"In place of the native FMU, {path} runs it on an emulated Cortex-M7 in any host." for path in self.files[1:]
        ]
        return [f"Type 'make -C {self.path} golden': it compiles and runs the golden vectors.", *loop]

    def to_json(self) -> dict[str, Any]:
        """Return the folder and the budgets."""
        return {"folder": self.path, "kind": self.kind, "bits": self.bits, "budgets": self.budgets}


@command
def flight(
    kind: Literal["compensator", "estimator", "filter", "detector", "watch"],
    *,
    out: Folder = "out/flight",
    artifact: File | None = None,
    scales: Scales | None = None,
    setup: File | None = None,
    noise: NotNegative | None = None,
    ageing: bool = True,
    float: Literal[64, 32] = 64,
    measure: bool = False,
    hil: bool = False,
    framework: Literal["fprime", "cfs"] | None = None,
) -> FlightCode:
    """Write a compensator or the detector as C for a flight processor.

    The folder holds C11 with an interface of its own, an example, golden vectors with their runner, and the interface as a
    page. The mathematics is that of the native FMU, bit by bit.

    Parameters
    ----------
    kind
        What to write: compensator (the exact inverse, or the direct one of an artifact that has it), estimator, filter,
        detector; or watch, which raises an alarm where readings leave stored healthy responses to a load that repeats.
    out
        Folder to write it to.
    artifact
        Identified sensor or trained detector: its file, or nominal, wide or single_damage, which ship with Gossamer.
    scales
        Of the identified sensor, in place of its own: resistance at rest [ohm], its rise to full scale [ohm] and full scale
        [1].
    setup
        Of the membrane that a watch is for, with its built-in pressure; the square of the thesis by default.
    noise
        Standard deviation of the strain that a watch reads [1]; 0.001 by default.
    ageing
        Let a compensator follow gain and offset of its sensor wherever the strain is known; the exact inverse alone needs
        half the RAM.
    float
        Bits of its numbers.
    measure
        Compile it for a Cortex-M7 and run it under QEMU, and write memory, stack and instructions to budgets.json; needs
        Debian's gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm.
    hil
        Also write an FMU that runs it on an emulated Cortex-M7, sample by sample; needs the same programs.
    framework
        Also write it as a component of F Prime or as an application of cFS, in a folder of its own.

    Returns
    -------
    FlightCode
        A path, with the budgets; displayed in a notebook.

    Examples
    --------
    >>> gossamer.flight("compensator", float=32)

    On the command line::

        gossamer flight compensator
        gossamer flight estimator --artifact out/mine/sensor.json --out out/flight --measure
        gossamer flight compensator --hil --framework fprime
        gossamer flight watch --setup sail.toml --noise 0.0005
    """
    from gossamer_fmus.catalogue import make_model
    from gossamer_fmus.flight import PERIOD, flight_files, golden_vectors
    from gossamer_fmus.flight_budgets import budgets, require_tools
    from gossamer_fmus.frameworks import framework_files
    from gossamer_fmus.in_the_loop import write_fmu_in_the_loop

    if measure or hil:
        require_tools("budgets need" if measure else "a processor in the loop needs")
    folder = Path(out)
    given: dict[str, Any] = {"artifact": None if artifact is None else Path(artifact), "scales": scales}
    bare: dict[str, Any] = {} if ageing else {"ageing": False}
    of_watch: dict[str, object] = {"setup": setup, "noise": noise}
    for name, value in (given | bare if kind == "watch" else of_watch).items():
        require(value is None, f"{option(name, None if value else value)} has no meaning for a {kind}. Leave it out.")
    require(noise is None or noise > 0.0, "--noise is what a watch compares with: it must be larger than 0.")
    if kind == "watch":
        model, vectors, golden, period = _watch(setup, DEFAULT_NOISE if noise is None else noise)
    else:
        model, period = make_model(kind, **given, **bare), PERIOD
        vectors, golden = golden_vectors(model, None if kind == "detector" else make_model("sensor", **given))
    files = flight_files(model, kind, vectors, golden, float, period)
    if framework is not None:
        framed = {name: files[name] for name in (f"{kind}.c", f"{kind}.h", f"{kind}_math.h", f"{kind}_table.h")}
        framed |= framework_files(model, kind, framework, float, period)
        files |= {f"{framework}/{name}": content for name, content in framed.items()}
    with uninterrupted(folder):
        with replacing_all([folder / name for name in files]) as places:
            for place, content in zip(places, files.values(), strict=True):
                place.write_bytes(content)
        (folder / "budgets.json").unlink(missing_ok=True)  # of another component
    in_the_loop = [write_fmu_in_the_loop(model, kind, folder)] if hil else []
    measured = budgets(folder, kind) if measure else {}
    if measured:
        write_text(folder / "budgets.json", json.dumps(measured, indent=1))
    return FlightCode(files=[folder, *in_the_loop], kind=kind, bits=float, budgets=measured)


def _watch(setup: AnyPath | None, noise: float) -> tuple[StepModel, tuple[Vector, Vector], Vector, float]:
    """Return the watch of a membrane with its golden vectors and their period [s]."""
    from gossamer_fmus.flight import vectors_of
    from gossamer_models import Stepper
    from gossamer_models.twin.on_board import example_inputs, watch_model
    from gossamer_models.twin.settled import stored_responses

    from .descriptions import load_structure

    with progress_bar("simulating the healthy response") as bar:
        stored = stored_responses(
            None if setup is None else load_structure(setup), report=lambda done: bar.update(done, 1.0)
        )
    model = watch_model(stored, noise)
    return model, *vectors_of(Stepper(model), example_inputs(stored, noise).T, stored.step), stored.step
