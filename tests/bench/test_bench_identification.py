"""A whole fit beside ``scipy.optimize.least_squares`` on the same residual from the same start."""

from gossamer_models.identification.assess import assess_speed


def test_fit_of_seven_modes():
    print()
    for figure in assess_speed():
        asked = "" if figure.asked is None else f" (asked {figure.asked:g})"
        print(f"{figure.what}: {figure.reached:.3g} {figure.unit}{asked}")
