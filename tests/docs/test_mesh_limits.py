"""What the README says of the detector on other meshes than the one that it was trained on."""

import pytest
from gossamer_models import Stepper
from gossamer_models.detector import posterior_model
from gossamer_models.membrane import membrane_model, square_structure

STEP = 3e-4
STRAINS = [f"strain[{i}]" for i in range(1, 5)]


def judged(elements, order, damage):
    """Damages [1] of the zones, their deviations [1] and ``valid`` after the first window."""
    membrane, detector = (Stepper(membrane_model(square_structure(elements, order)), **damage), Stepper(posterior_model()))
    membrane.initialize()
    for name in STRAINS:
        detector.set(name, membrane.get(name))
    detector.initialize()
    for _ in range(844):
        membrane.step(STEP)
        for name in STRAINS:
            detector.set(name, membrane.get(name))
        detector.step(STEP)
    found, deviation = ([detector.get(f"{name}[{zone}]") for zone in range(1, 17)] for name in ("damage", "deviation"))
    return found, deviation, detector.get("valid") == 1.0


@pytest.mark.parametrize(("elements", "order"), [(4, 6), (8, 4)])
def test_a_finer_spectral_mesh_does_the_detector_little_harm(elements, order):
    found, deviation, valid = judged(elements, order, {"damage[1]": 0.3})
    assert valid
    assert found[0] == pytest.approx(0.3, abs=0.015)
    assert deviation[0] < 0.02
    assert max(found[1:]) < 0.015


@pytest.mark.parametrize(("elements", "seen", "spread"), [(8, 0.39, 0.13), (16, 0.26, 0.09)])
def test_a_bilinear_mesh_looks_damaged_to_the_detector_and_no_such_zone_is_determined(elements, seen, spread):
    found, deviation, _ = judged(elements, 1, {})
    worst = max(range(16), key=found.__getitem__)
    assert found[worst] == pytest.approx(seen, abs=0.02)
    assert deviation[worst] == pytest.approx(spread, abs=0.01)
    assert all(sd > 0.02 for damage, sd in zip(found, deviation, strict=True) if damage > 0.0)
