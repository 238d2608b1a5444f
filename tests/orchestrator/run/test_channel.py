"""What noise, bias, gain and dropout do to a signal."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
from gossamer_orchestrator.run.signals import Channel
from gossamer_orchestrator.scenario.schema import Connection
from hypothesis import given
from hypothesis import strategies as st

TICKS = 200
values = st.floats(-1e6, 1e6)
seeds = st.integers(0, 2**32)


def channel(target: str = "b.u", **manipulators: object) -> Channel:
    return Channel(Connection.model_validate({"from": "a.y", "to": target, **manipulators}))


def send(channel: Channel, signal: list[float]) -> list[float]:
    return [channel(value, k) for k, value in enumerate(signal)]


@given(st.lists(values, max_size=TICKS), values, values)
def test_gain_and_bias_are_affine(signal, gain, bias):
    assert send(channel(gain=gain, bias=bias), signal) == [gain * x + bias for x in signal]


def test_a_connection_without_manipulators_is_a_plain_wire():
    connection = Connection.model_validate({"from": "a.y", "to": "b.u"})
    assert connection.is_plain


@given(seeds, st.sampled_from(["uniform", "normal"]), st.floats(0.0, 10.0))
def test_a_seed_reproduces_its_noise_and_repeating_a_sample_repeats_it(seed, kind, amplitude):
    noise = {"kind": kind, "amplitude": amplitude, "seed": seed}
    first, second = channel(noise=noise), channel(noise=noise)
    expected = send(first, [0.0] * TICKS)
    assert [second(0.0, k) for k in reversed(range(TICKS))][::-1] == expected
    if amplitude > 1e-9:
        assert send(channel(noise=noise | {"seed": seed + 1}), [0.0] * TICKS) != expected
        assert send(channel("c.u", noise=noise), [0.0] * TICKS) != expected


@given(seeds, st.floats(0.0, 10.0))
def test_uniform_noise_stays_within_its_amplitude(seed, amplitude):
    sent = np.array(send(channel(noise={"kind": "uniform", "amplitude": amplitude, "seed": seed}), [0.0] * TICKS))
    assert np.all(np.abs(sent) <= amplitude)


@pytest.mark.parametrize(("kind", "draw"), [("uniform", "uniform"), ("normal", "normal")])
def test_noise_drawn_in_blocks_is_that_of_one_draw(kind, draw):
    """Earlier versions drew the noise of the whole run at once."""
    size = 10_000
    generator = np.random.default_rng([5, zlib.crc32(b"b.u"), 0])
    whole = generator.uniform(-1.0, 1.0, size) if draw == "uniform" else generator.normal(size=size)
    noisy = channel(noise={"kind": kind, "amplitude": 0.7, "seed": 5})
    assert [noisy(0.0, k) for k in range(size)] == (0.7 * whole).tolist()
    assert noisy(0.0, 17) == 0.7 * whole[17]


def test_dropouts_drawn_in_blocks_are_those_of_one_draw():
    size = 10_000
    lost = np.random.default_rng([5, zlib.crc32(b"b.u"), 1]).random(size) < 0.3
    lossy = channel(dropout={"probability": 0.3, "seed": 5, "hold": False})
    assert [lossy(1.0, k) == 0.0 for k in range(size)] == lost.tolist()


def test_normal_noise_has_its_amplitude_as_standard_deviation():
    connection = Connection.model_validate(
        {"from": "a.y", "to": "b.u", "noise": {"kind": "normal", "amplitude": 2.0, "seed": 1}}
    )
    long = Channel(connection)
    assert np.std([long(0.0, k) for k in range(100_000)]) == pytest.approx(2.0, rel=0.02)


@given(seeds, st.floats(0.0, 1.0))
def test_a_lost_sample_is_held_or_zero(seed, probability):
    signal = [float(k + 1) for k in range(TICKS)]
    lost = {"probability": probability, "seed": seed}
    held = send(channel(dropout=lost | {"hold": True}), signal)
    zero = send(channel(dropout=lost | {"hold": False}), signal)
    assert held[0] == 1.0
    for k in range(1, TICKS):
        assert zero[k] in (0.0, signal[k])
        assert held[k] == (signal[k] if zero[k] else held[k - 1])


def test_dropouts_have_their_probability():
    assert np.mean(np.array(send(channel(dropout={"probability": 0.25, "hold": False}), [1.0] * TICKS)) == 0.0) == (
        pytest.approx(0.25, abs=0.1)
    )
    assert send(channel(dropout={"probability": 0.0}), [1.0, 2.0]) == [1.0, 2.0]
    assert send(channel(dropout={"probability": 1.0}), [1.0, 2.0]) == [1.0, 1.0]
