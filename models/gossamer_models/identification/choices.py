"""Every model that can be identified, by name, and the options that it has."""

from __future__ import annotations

from typing import Any

from ..errors import ParameterError
from ..fractional import FractionalSettings
from ..fractional.artifact import MODELS as FRACTIONAL
from .fractional import FractionalChoice
from .run import settings_for
from .settings import FitSettings

_COMMON = ("relaxations", "tau", "exponents", "extension", "direct_inverse", "least_slope", "ridge", "earlier")
OPTIONS: dict[str, tuple[str, ...]] = {  # besides starts and seed, which all have
    "preisach": ("modes", *_COMMON),
    "preisach-hats": ("knots", *_COMMON),
    **{f"fractional-{model}": ("terms", "fading") if model == "model-1" else ("terms",) for model in FRACTIONAL},
}


def choose(model: str, *, starts: int | None = None, seed: int = 0, **options: Any) -> FitSettings | FractionalChoice:  # noqa: ANN401
    """Return how to fit a model.

    Parameters
    ----------
    model : str
        A key of ``OPTIONS``: preisach, preisach-hats, fractional-model-1 and its like.
    starts, seed : int
        How many starts, None for as many as the model needs, and their seed.
    **options
        Of the model, see ``settings_for``, or ``terms`` and ``fading``, numbers of fractional terms and of fading integrals
        (N and M - N of Eq. (3.15)); those that are None take its defaults.

    Returns
    -------
    FitSettings or FractionalChoice
        For ``identify_files``.

    Raises
    ------
    ParameterError
        There is no such model, or it has no such option.
    """
    if model not in OPTIONS:
        msg = f"there is no {model!r}; it is one of {', '.join(OPTIONS)}"
        raise ParameterError(msg)
    given = {name: value for name, value in options.items() if value is not None}
    for name in given:
        if name not in OPTIONS[model]:
            others = " or ".join(other for other, has in OPTIONS.items() if name in has)
            flag = f"--{name.replace('_', '-')}"
            msg = f"{model} has no {name.replace('_', ' ')}. Leave {flag} out, or choose --model {others}."
            raise ParameterError(msg)
    if starts is not None:
        given["starts"] = starts
    if not model.startswith("fractional-"):
        return settings_for(model, seed=seed, **given)
    names = {"terms": "n_terms", "fading": "n_fading"}
    settings = FractionalSettings(seed=seed, **{names.get(name, name): value for name, value in given.items()})
    (kind,) = (each for each in FRACTIONAL if model == f"fractional-{each}")
    return FractionalChoice(model=kind, settings=settings)
