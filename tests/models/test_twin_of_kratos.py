"""Twins find what another program has damaged: ``docs/studies/kratos`` computed the records with Kratos."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gossamer.descriptions import load_structure
from gossamer_models.twin import Twin, read_table

ROOT = Path(__file__).parents[2]
RECORDS = sorted((ROOT / "tests/oracles/kratos").glob("*.csv"))
SETUPS = {"dish": "reflector", "sail": "sail"}
NOISE, READINGS = 1e-4, 10


def read(path):
    """Return a structure, its damage, and the record with noise: ten readings of each state of the sail."""
    structure = load_structure(ROOT / f"orchestrator/membranes/{SETUPS[path.stem[:-2]]}.toml", None)
    damage = np.zeros(structure.n_zones)
    for share, zone in re.findall(r"([\d.]+) in zone (\d+)", path.read_text(encoding="utf-8")):
        damage[int(zone) - 1] = float(share)
    record = read_table(path, noise=NOISE, structure=structure)
    if path.stem.startswith("sail"):
        values = np.repeat(record.values, READINGS, axis=1)
        record = replace(record, values=values, state=np.repeat(record.state, READINGS))
    noise = NOISE * np.random.default_rng(1).standard_normal(record.values.shape)
    return structure, damage, replace(record, values=record.values + noise)


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: path.stem)
def test_a_twin_finds_the_damage_of_a_structure_that_kratos_has_computed(path):
    structure, damage, record = read(path)
    answer = Twin(structure, discrepancy=None).fit(record)
    assert answer.valid
    assert np.array_equal(answer.damage > 0.0, damage > 0.0)
    error = np.abs(answer.damage - damage)
    assert (error < 3.0 * answer.deviation).all()
    assert 100.0 * error.mean() < 0.6
    assert 100.0 * error[damage > 0.0].mean() < 4.0
