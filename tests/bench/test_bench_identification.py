"""A whole fit beside ``scipy.optimize.least_squares`` on the same residual from the same start."""

from studies.metrics import beside_target
from studies.speed import run_speed


def test_fit_of_seven_modes(measured):
    print()
    for metric in run_speed() if measured else run_speed(neighbours=0, evaluations=1):
        print(f"{metric.what}: {beside_target(metric)} {metric.unit}")
