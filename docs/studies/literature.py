"""What others have measured, and how far it compares with the measured records of this page."""

from __future__ import annotations

INTRODUCTION = """\
Published figures beside ours, as their abstracts and code state them; nothing was run again. None was measured on the
stretches of the tables above, and most are errors of another kind, so **none of them ranks anything here**."""

# work, what was measured and on what, whether it compares with the tables of this chapter
WORKS: tuple[tuple[str, str, str], ...] = (
    (
        "R. Aigner, A. Stöckl, arXiv:2306.12129, 2023: exponential smoothings of the signal into a network of 8 neurons",
        "force, and in the supplement elongation, from the conductance of knitted sensors of two yarns; R²",
        "Not in number: other sensors, and R² depends on the spread of the signal. In kind it is our perceptron on lags and "
        "low-passes.",
    ),
    (
        "S. A. Baker et al., Sensors 22(14), 5239, 2022, doi:10.3390/s22145239: a quasi-static law plus decaying spikes, "
        "inverted",
        "strain of high-deflection composite gauges under cyclic load, each calibrated at two known strains; mean absolute "
        "error 1.4 % strain",
        "No: points of strain rather than % of range, mean absolute rather than root mean square, cycles only. It needs far "
        "less calibration than any model here.",
    ),
    (
        "Gaussian process on 20 past samples, repository roboticslab-uc3m/nylon-silver-soft-sensor",
        "strain and stress of silver-coated polyamide threads; root mean square error 8.75 ± 4.06 %, other regressions "
        "12.70 ± 7.04 %",
        "Nearest: our silver thread comes from there. But one model is fitted to all recordings in a row, and the last "
        "seventh of the row is predicted; here each record predicts its own second half. It is sometimes quoted "
        "for carbon black, which it was not measured on.",
    ),
    (
        "C. Grech et al., Materials 13(11), 2563, 2020, doi:10.3390/ma13112563: Preisach plays into a recurrent network",
        "flux density of pure iron at ramp rates outside its six training loops; NRMSE below 0.7 %",
        "No: iron under smooth ramps, neither relaxation nor drift, and the output only. In kind it is our residual "
        "network, which sees the plays too.",
    ),
    (
        "H. Vater et al., arXiv:2603.29745, 2026: gated recurrent unit of 325 parameters",
        "field from flux density in five ferrites at several temperatures; sequence relative error 8.02 %, energy 1.07 %",
        "No: relative to the size of each sequence, and each begins with a stretch of known field. In kind and "
        "size it is our gated network.",
    ),
    (
        "R. Roussel et al., Physical Review Letters 128, 204801, 2022, doi:10.1103/PhysRevLett.128.204801, repository "
        "roussel-ryan/diff_hysteresis: differentiable Preisach model",
        "field and beam response of accelerator magnets, for optimisation with hysteresis",
        "No: rate independent, without relaxation, and nothing is recovered. The fit by derivatives of the model is the one "
        "used here.",
    ),
)
