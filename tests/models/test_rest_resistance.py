"""A fitted resistance at rest is positive, so that an artifact has the scales that its FMUs start with."""

from dataclasses import replace

import pytest
from gossamer_models.sensor.fit import PreisachSettings, fit_preisach
from gossamer_models.sensor.fit.doubts import doubts
from oracles.records import everything

QUICK = PreisachSettings(modes=2, relaxations=1, starts=1, earlier=True)


def test_what_was_still_relaxing_cannot_take_the_whole_resistance(known):
    """A record that begins high and sinks throughout would give the rest a resistance below zero."""
    sinking = replace(known, resistance=known.resistance - 99.0 + 100.0 * (1.0 - known.time / known.time[-1]))
    fit = fit_preisach((sinking,), everything(sinking), QUICK, full_scale=1.0)
    assert fit.artifact.scales.rest_resistance == pytest.approx(0.01 * sinking.resistance.min(), rel=1e-9)
    assert any("is the least that is allowed" in text and "rest_resistance=" in text for text in doubts(fit))


def test_an_output_that_is_negative_somewhere_is_a_signal_and_not_bounded(known):
    signal = replace(known, resistance=known.resistance - known.resistance.mean())
    assert fit_preisach((signal,), everything(signal), QUICK, full_scale=1.0).rest_resistance < 0.0
