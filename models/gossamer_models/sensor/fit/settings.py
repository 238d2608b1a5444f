"""Settings of a fit of the modified Preisach model, with their checks."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Literal, TypedDict

from ...errors import require
from ..drives import EXTENSIONS, Drive

PRESETS: dict[str, dict[str, Any]] = {"preisach": {}, "preisach-hats": {"density": "hats", "density_ridge": 3e-3}}
MODELS = tuple(PRESETS)
FORGETTING = (2.0, 4.0, 8.0)


class Given(TypedDict):
    """What is known of a sensor before a fit: full scale [1] and, unless it is None, resistance at rest [ohm]."""

    full_scale: float
    rest_resistance: float | None


@dataclass(frozen=True, kw_only=True)
class PreisachSettings:
    r"""How to fit.

    Attributes
    ----------
    modes, relaxations : int
        M modal functions each for mu and eta, and P kernels.
    knots : int
        Knots of the hat functions along each axis.
    tau : tuple of float or None
        Times [s] of the kernels; None to fit them.
    exponents : tuple of float or None
        Exponents c [1] of the kernels, in (0, 1]; None to fit them.
    extension : str
        Key of ``EXTENSIONS``: what excites the relaxation besides the thesis' rising strain.
    ridge : float, "auto" or None
        Value for both ``density_ridge`` and ``relaxation_ridge``; "auto" chooses it by predicting the later parts of the
        training stretch; None leaves them as they are.
    residual : int or "auto"
        Iterations in which a network is trained on what the sensor leaves over; 0 for no network.
    earlier : bool
        Whether relaxation from before a record may still be under way when it begins; the resulting sensor does not
        include it.
    direct_inverse : bool
        Whether to fit the direct inverse from resistance to strain too; it then replaces the exact inverse.
    delay : int
        Samples by which its strain may be late: 0, or one of ``direct.AHEAD``.
    least_slope, least_weight : float
        Lower bounds of mu on the elastic line and on all others, in units of the output's range. Noise on the resistance is
        amplified by no more than the inverse of the first.
    starts, seed : int
        Number of starts, and the seed of all but the first.
    density : {"modal", "hats"}
        Modal functions of Eqs. (4.16) and (4.17) of the thesis, or hat functions on a coarse grid of the triangle with one
        eta. Both have an elastic line :math:`\alpha = \beta` of their own: operators of no width, which a smooth density
        cannot represent. The thesis' equations have none.
    n_lines : int
        Lines and bins along a line of the finished tables.
    signed : bool
        Whether amplitudes of relaxation may be negative.
    invertible : bool
        Whether the output must fall with falling strain in a step of any size, so that the exact inverse exists.
    eta : tuple of float
        Least and largest eta [1].
    fit_kernels : bool
        False fixes all kernels: exponentials with times evenly spaced in the logarithm from a sample to the record.
    smoothness, density_ridge, eta_stiffness, kernel_stiffness, relaxation_ridge : float
        Pulls towards a flat and a small density mu, eta = 1, the first kernels and small relaxation, relative to noise of
        the size of the output's range. The density of the elastic line is free, so hysteresis and drift appear only if the
        data require them.
    most_iterations : int
        Most iterations per start.
    forgetting : float
        How often the movement of the training stretch erases memory [1]: ``SensorArtifact.fading`` times that movement. If
        it is above 0, it is the least of itself and ``FORGETTING`` with which the output settles, see ``endurance.py``.
    """

    OPTIONS: ClassVar[dict[str, tuple[str, ...]]] = {  # what a user may choose, and the models that have it
        **dict.fromkeys(("relaxations", "tau", "exponents", "extension", "ridge", "earlier", "direct_inverse"), MODELS),
        **dict.fromkeys(("residual", "least_slope", "starts", "seed"), MODELS),
        "modes": ("preisach",),
        "knots": ("preisach-hats",),
    }

    modes: int = 7
    knots: int = 9
    relaxations: int = 7
    tau: tuple[float, ...] | None = None
    exponents: tuple[float, ...] | None = None
    extension: str = "none"
    ridge: float | Literal["auto"] | None = None
    earlier: bool = False
    direct_inverse: bool = False
    delay: int = 0
    residual: int | Literal["auto"] = 0
    least_slope: float = 0.02
    starts: int = 2
    seed: int = 0

    density: Literal["modal", "hats"] = "modal"
    n_lines: int = 32
    signed: bool = False
    invertible: bool = True
    eta: tuple[float, float] = (0.5, 1.2)
    fit_kernels: bool = True
    least_weight: float = 1e-4
    smoothness: float = 3e-2
    density_ridge: float = 0.1
    eta_stiffness: float = 1.0
    kernel_stiffness: float = 1e-3
    relaxation_ridge: float = 1e-3
    most_iterations: int = 60
    forgetting: float = 0.0

    @classmethod
    def of(cls, model: str, **chosen: Any) -> PreisachSettings:  # noqa: ANN401
        """Return the settings of a model and, if one is chosen, of an extension; ``chosen`` fields override both."""
        require(model in PRESETS, f"there is no model {model!r}; choose one of {', '.join(PRESETS)}")
        extension = EXTENSIONS.get(chosen.get("extension", "none"), EXTENSIONS["none"])
        return cls(**{**PRESETS[model], **extension.settings, **chosen})

    @property
    def drives(self) -> tuple[Drive, ...]:
        """What excites the relaxation."""
        return EXTENSIONS[self.extension].drives

    @property
    def forgettings(self) -> tuple[float, ...]:
        """What to try, the slowest first."""
        return (self.forgetting, *(each for each in FORGETTING if 0.0 < self.forgetting < each))

    def __post_init__(self) -> None:
        name, P = self.extension, self.relaxations
        require(name in EXTENSIONS, f"there is no extension {name!r}; choose one of {', '.join(EXTENSIONS)}")
        if self.ridge not in (None, "auto"):
            for each in ("density_ridge", "relaxation_ridge"):
                object.__setattr__(self, each, float(self.ridge))
        require(
            self.modes > 0 and P >= 0 and self.starts > 0 and self.n_lines > 3,
            f"cannot fit {self.modes} modes, {P} relaxations, {self.n_lines} lines from {self.starts} starts: take at least "
            "1 mode, 0 relaxations, 4 lines and 1 start",
        )
        require(
            0.0 <= self.density_ridge < inf and 0.0 <= self.relaxation_ridge < inf,
            f"the ridge is {self.density_ridge:g} for densities and {self.relaxation_ridge:g} for relaxation: take a finite "
            "one of 0 or more",
        )
        require(self.seed >= 0, f"the seed is {self.seed}: it must not be negative")
        require(
            name == "none" or P > 0,
            f"the extension {name} needs relaxation, but relaxations is 0. Take 1 relaxation or more.",
        )
        require(
            self.fit_kernels or (self.tau is None and self.exponents is None),
            f"the extension {name} has its own fixed kernels. Leave tau and exponents out, or choose another extension.",
        )
        for what, values in (("tau", self.tau), ("exponents", self.exponents)):
            count = P if values is None else len(values)
            require(count == P, f"need one value of {what} per relaxation: {count} != {P}")
        require(
            all(0.0 < t < inf for t in self.tau or ()) and all(0.0 < c <= 1.0 for c in self.exponents or ()),
            f"kernels need times above 0 s and exponents in (0, 1], not {self.tau} and {self.exponents}",
        )
        require(
            0.0 < self.least_slope < 1.0,
            f"the least slope is {self.least_slope:g} of the output's range: take one between 0 and 1",
        )
        require(
            self.density != "hats" or 2 <= self.knots < self.n_lines,
            f"cannot lay {self.knots} knots over {self.n_lines} lines: take 2 or more knots, and fewer than lines",
        )
