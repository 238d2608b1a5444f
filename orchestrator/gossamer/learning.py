"""What is learnt from measured records: a sensor, and how good it is.

Made by ``docs/make_front_door.py`` from the table of the command line: change the command, then run ``make goldens``.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .results.learning import Assessment, Identification


def identify(
    files: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    out: str | PathLike[str] = "out/identified/sensor.json",
    model: str | None = None,
    budget: float | None = None,
    train: str = "50%",
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    weights: str | Sequence[float] | None = None,
    own_scales: bool = False,
    origin: str = "not stated",
    pictures: bool = True,
    format: str = "png",
    time: str | None = None,
    strain: str | None = None,
    resistance: str | None = None,
    time_unit: str | None = None,
    strain_unit: str | None = None,
    resistance_unit: str | None = None,
    sampling_step: float | None = None,
    sort: bool = False,
    modes: int | None = None,
    knots: int | None = None,
    relaxations: int | None = None,
    tau: str | Sequence[float] | None = None,
    exponents: str | Sequence[float] | None = None,
    extension: str | None = None,
    ridge: float | str | None = None,
    earlier: bool = False,
    direct_inverse: bool = False,
    residual: float | str | None = None,
    least_slope: float | None = None,
    starts: int | None = None,
    seed: int | None = None,
    terms: int | None = None,
    fading: int | None = None,
) -> Identification:
    """Identify a sensor from measured strain and resistance.

    Models:

    - auto: chooses sensor, relaxation, regularisation, direct inverse and compensator by predicting the later parts of the
      training stretch. Sensor and compensator; ``build`` takes the compensator that was chosen.
    - preisach: modified Preisach with modal densities. Sensor and compensator.
    - preisach-hats: the same with hat functions, which follow rich records more closely. Sensor and compensator.
    - fractional-sub-model-1: fractional integrals, Eq. (3.21) of the thesis. Sensor.
    - fractional-model-1, fractional-sub-model-2: with phases, Eqs. (3.15) and (3.25). Offline only, no FMUs.

    Parameters
    ----------
    files : path or sequence of path
        CSV files with a header line; each is a record of one sensor.
    out : path, default "out/identified/sensor.json"
        File to write; pictures and page go beside it.
    model : str or None
        One of those above; auto if no option of a model is given, else preisach.
    budget : float or None
        Of --model auto: seconds after which it tries no more settings; 60 if not given. The few that it must
        try, the last fit, the checks and the pictures take half a minute more, or longer for long records.
    train : str, default "50%"
        What to fit: 0:200 for seconds from the first sample, 50% for a leading part; the rest is a test.
    full_scale : float or None
        Strain [1] at the end of the range; the largest if not given.
    rest_resistance : float or None
        Resistance at rest [ohm] where it is known; fitted if not given.
    weights : sequence of float, str or None
        Of each record's squared errors: 1,0.5 for two files; 1 if not given.
    own_scales : bool, default False
        Each record has its own offset and gain: re-mounted, another temperature, drift.
    origin : str, default "not stated"
        Where the data come from, for the provenance.
    pictures : bool, default True
        Draw pictures of the fit, and write report.html, the page of them all.
    format : str, default "png"
        Of the pictures: png, svg or pdf.
    time : str or None
        Column of time; recognised if not given.
    strain : str or None
        Column of strain.
    resistance : str or None
        Column of resistance.
    time_unit : str or None
        s, ms, us, min or h.
    strain_unit : str or None
        1, %, permille or ustrain.
    resistance_unit : str or None
        ohm, kohm or Mohm; 1 for a signal.
    sampling_step : float or None
        Time between samples [s] of a record without time.
    sort : bool, default False
        Sort samples by time instead of refusing them.
    modes : int or None
        Of preisach: modal functions of mu and of eta. 7 if not given.
    knots : int or None
        Of preisach-hats: knots of the hat functions along each axis. 9 if not given.
    relaxations : int or None
        Relaxation kernels. 7 if not given.
    tau : sequence of float, str or None
        Times of the kernels [s], one per relaxation: 3,100. Fitted if not given.
    exponents : sequence of float, str or None
        Exponents of the kernels in (0, 1]: 0.5,0.5. Fitted if not given.
    extension : str or None
        Added to the thesis' relaxation: falling (falling strain excites relaxation too), gain (loading changes
        the gauge factor), reversing (both, with either sign: carbon black). Nothing if not given.
    ridge : float, str or None
        Strength of the regularisation, which prefers small densities and relaxation: a number, or auto to
        choose it by predicting the later parts of the training stretch.
    earlier : bool, default False
        The sensor was not at rest when its record began: fit the earlier relaxation too.
    direct_inverse : bool, default False
        Fit a direct inverse from resistance to strain too, for the compensator.
    residual : float, str or None
        Correct the sensor by a small network: training steps, or auto to choose them, or none, by predicting
        the later parts of the training stretch. None if not given.
    least_slope : float or None
        Least slope, in the output's range per full scale: limits how much the compensator amplifies noise. 0.02
        if not given.
    starts : int or None
        Number of starts. 2 for the Preisach models and 12 for the fractional models if not given.
    seed : int or None
        Seed of the starts. 0 if not given.
    terms : int or None
        Fractional derivatives or integrals. 5 if not given.
    fading : int or None
        Of fractional-model-1: fading integrals. 3 if not given.

    Returns
    -------
    Identification
        Artifact, errors and records; a path of the artifact; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.identify("measured.csv", modes=7, relaxations=7, train="0:200", out="out/mine/sensor.json")
    """
    given = vars()
    from . import table
    from .work import learning as work

    with table.words_of_python("identify"):
        return work.identify(**table.values("identify", given))


def assess(
    sensor: str | PathLike[str],
    files: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    compensator: str | Sequence[str] | None = None,
    fit_scales: bool = False,
    stretch: str = "50%",
    out: str | PathLike[str] = "out/assessed",
    pictures: bool = True,
    format: str = "png",
    time: str | None = None,
    strain: str | None = None,
    resistance: str | None = None,
    time_unit: str | None = None,
    strain_unit: str | None = None,
    resistance_unit: str | None = None,
    sampling_step: float | None = None,
    sort: bool = False,
) -> Assessment:
    """Judge an identified sensor on other records, without fitting it.

    Parameters
    ----------
    sensor : path
        Artifact of gossamer identify.
    files : path or sequence of path
        CSV files with a header line, one record each.
    compensator : str, sequence of str or None
        What recovers strain; may be repeated: inverse (its direct one where it has one), exact, estimator,
        filter. The one that the artifact names by default.
    fit_scales : bool, default False
        Find gain, offset and what was still relaxing of each record in its first stretch, and judge the rest:
        for a sensor that was mounted again, is warmer, or has drifted.
    stretch : str, default "50%"
        First stretch of each record: 0:200 for seconds, 50% for a leading part.
    out : path, default "out/assessed"
        Folder of predictions, pictures and page.
    pictures : bool, default True
        Draw pictures, and write report.html, the page of them all.
    format : str, default "png"
        Of the pictures: png, svg or pdf.
    time : str or None
        Column of time; recognised if not given.
    strain : str or None
        Column of strain.
    resistance : str or None
        Column of resistance.
    time_unit : str or None
        s, ms, us, min or h.
    strain_unit : str or None
        1, %, permille or ustrain.
    resistance_unit : str or None
        ohm, kohm or Mohm; 1 for a signal.
    sampling_step : float or None
        Time between samples [s] of a record without time.
    sort : bool, default False
        Sort samples by time instead of refusing them.

    Returns
    -------
    Assessment
        Errors and records; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.assess("out/mine/sensor.json", "other.csv", fit_scales=True)
    """
    given = vars()
    from . import table
    from .work import learning as work

    with table.words_of_python("assess"):
        return work.assess(**table.values("assess", given))
