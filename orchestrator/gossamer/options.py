"""Options that several commands have, declared once for all of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

from . import arguments as kinds


class ScenarioOptions(TypedDict, total=False):
    """FMUs and times.

    Attributes
    ----------
    fmus
        Folder of the FMUs that scenarios name.
    step
        Communication step [s] in place of the file's.
    stop
        Last time [s] in place of the file's.
    """

    fmus: Annotated[kinds.AnyPath, kinds.Written("FOLDER", default="out/fmus")]
    step: float | None
    stop: float | None


class ChangeOptions(TypedDict, total=False):
    """Changes and checks.

    Attributes
    ----------
    set
        Value in place of the file's, such as membrane.damage[1]=0.3 or estimator?.noise=0.2; seed=2 is that of all noise. As
        often as needed.
    master
        In place of the file's, or for an .ssp.
    limit
        Time that one call of an FMU may take [s]; one that takes longer ends the run.
    strict
        Refuse FMUs that break the rules of FMI, values that are not finite, groups that do not converge, and steps that miss
        the tolerance of the step control.
    """

    set: kinds.Values | None
    master: Literal["gauss-seidel", "jacobi"] | None
    limit: kinds.CallLimit | None
    strict: bool


class RunOptions(ScenarioOptions, ChangeOptions):
    """FMUs and times, changes and checks."""


class TwinOptions(TypedDict, total=False):
    """Record and twin.

    Attributes
    ----------
    kind
        What to read, where the record has both; compensated: the strain that compensators recovered in a run.
    noise
        Standard deviation of the noise, 1 or ohm; estimated by default.
    setup
        Setup of another membrane than the square of the thesis (docs/setup.md), or sail, drum, ...; results of a run bring
        theirs.
    begins
        rest: the record begins at rest at time 0, before the loads of its columns set in. equilibrium: with its first row,
        in equilibrium under its loads; by default where it has columns of loads.
    set
        A parameter of the membrane, or a load at the start; may be repeated.
    calibration
        What gossamer calibrate wrote of healthy records: values of the structure's numbers, and how well they are known.
    sensor
        Artifact of the sensors; the shipped one by default.
    elements_per_side
        Elements along a side of the square, a multiple of 4.
    order
        Their order; 1 for bilinear ones.
    """

    kind: Literal["strain", "resistance", "compensated"] | None
    noise: kinds.NotNegative | None
    setup: kinds.File | None
    begins: Literal["rest", "equilibrium"] | None
    set: kinds.Values | None
    calibration: kinds.File | None
    sensor: kinds.File | None
    elements_per_side: Annotated[int, kinds.Written("N", default=4)]
    order: Annotated[int, kinds.Written("N", default=4)]


class PlanOptions(TypedDict, total=False):
    """What is simulated.

    Attributes
    ----------
    setup
        Setup of the membrane, with zones and sensors (docs/setup.md), or reflector, drum, ...; steps, windows and load are
        those of the structure.
    mesh
        With a setup: mesh file in place of its own.
    set
        Parameter or constant input of the membrane, NAME=VALUE; may be repeated.
    load
        With a setup: CSV table of what acts over time beside or in place of the built-in pressure, columns of inputs with
        units beside time (docs/placement.md); it is a period of the load, and repeated.
    cases
        How many, in place of the campaign's; 4000 of a setup.
    noise
        Standard deviation of a sample of strain [1], in place of the campaign's; 1e-4 of a setup.
    """

    setup: kinds.File | None
    mesh: kinds.File | None
    set: kinds.Values | None
    load: kinds.File | None
    cases: kinds.Count | None
    noise: kinds.NotNegative | None


class ColumnOptions(TypedDict, total=False):
    """Columns of the records.

    Attributes
    ----------
    time
        Column of time; recognised if not given.
    strain
        Column of strain.
    resistance
        Column of resistance.
    time_unit
        s, ms, us, min or h.
    strain_unit
        1, %, permille or ustrain.
    resistance_unit
        ohm, kohm or Mohm; 1 for a signal.
    sampling_step
        Time between samples [s] of a record without time.
    sort
        Sort samples by time instead of refusing them.
    """

    time: kinds.Name | None
    strain: kinds.Name | None
    resistance: kinds.Name | None
    time_unit: str | None
    strain_unit: str | None
    resistance_unit: str | None
    sampling_step: float | None
    sort: bool


class PreisachOptions(TypedDict, total=False):
    """Options of the Preisach models.

    Attributes
    ----------
    modes
        Of preisach: modal functions of mu and of eta. 7 if not given.
    knots
        Of preisach-hats: knots of the hat functions along each axis. 9 if not given.
    relaxations
        Relaxation kernels. 7 if not given.
    tau
        Times of the kernels [s], one per relaxation: 3,100. Fitted if not given.
    exponents
        Exponents of the kernels in (0, 1]: 0.5,0.5. Fitted if not given.
    extension
        Added to the thesis' relaxation: falling (falling strain excites relaxation too), gain (loading changes the gauge
        factor), reversing (both, with either sign: carbon black). Nothing if not given.
    ridge
        Strength of the regularisation, which prefers small densities and relaxation: a number, or auto to choose it by
        predicting the later parts of the training stretch.
    earlier
        The sensor was not at rest when its record began: fit the earlier relaxation too.
    direct_inverse
        Fit a direct inverse from resistance to strain too, for the compensator.
    residual
        Correct the sensor by a small network: training steps, or auto to choose them, or none, by predicting the later parts
        of the training stretch. None if not given.
    least_slope
        Least slope, in the output's range per full scale: limits how much the compensator amplifies noise. 0.02 if not
        given.
    """

    modes: kinds.Count | None
    knots: int | None
    relaxations: kinds.CountOrNone | None
    tau: kinds.Numbers | None
    exponents: kinds.Numbers | None
    extension: kinds.Name | None
    ridge: kinds.NumberOrAuto | None
    earlier: bool
    direct_inverse: bool
    residual: kinds.CountOrAuto | None
    least_slope: float | None


class FractionalOptions(TypedDict, total=False):
    """Options of the fractional models.

    Attributes
    ----------
    terms
        Fractional derivatives or integrals. 5 if not given.
    fading
        Of fractional-model-1: fading integrals. 3 if not given.
    """

    terms: kinds.Count | None
    fading: kinds.CountOrNone | None


class CommonOptions(TypedDict, total=False):
    """Options of all models.

    Attributes
    ----------
    starts
        Number of starts. 2 for the Preisach models and 12 for the fractional models if not given.
    seed
        Seed of the starts. 0 if not given.
    """

    starts: kinds.Count | None
    seed: kinds.CountOrNone | None


class FitOptions(ColumnOptions, CommonOptions, PreisachOptions, FractionalOptions):
    """Columns of the records, and options of the models."""


kinds.GROUPS[RunOptions] = (ScenarioOptions, ChangeOptions)
kinds.GROUPS[FitOptions] = (CommonOptions, ColumnOptions, PreisachOptions, FractionalOptions)


def as_settings(fmus: kinds.AnyPath, set: kinds.Values | None, **others: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return the options of a run as ``run_scenario`` takes them."""
    from gossamer_orchestrator.scenario.values import read_changes

    return others | {"fmus": Path(fmus), "values": read_changes(kinds.assigned(set))}
