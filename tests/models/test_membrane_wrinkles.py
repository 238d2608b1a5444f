"""Wrinkled membranes from a mesh, by the relaxed law, against tension-field solutions."""

from pathlib import Path

import numpy as np
import pytest
from gossamer_models.membrane import Load, Region, Support
from oracles.meshes import annulus, disc, meshed, rectangle, started
from scipy.optimize import fsolve
from studies.kratos.airbag import airbag
from studies.kratos.records import at_rest

ORACLES = Path(__file__).parents[1] / "oracles"
E, NU = 1e9, 0.3


def test_an_annulus_whose_hub_shrinks_wrinkles_as_in_closed_form():
    """Wrinkled within a circle, where u' = c/(E r), taut outside, where u = A r + B/r; both meet where hoop stress ends."""
    a, b, u0 = 0.1, 0.5, 1e-5
    file = meshed(
        [annulus(a, b, 0.25)],
        (8, 24),
        edges={
            "hub": lambda x, y, z: np.hypot(x, y) < a + 1e-9,
            "rim": lambda x, y, z: np.hypot(x, y) > b - 1e-9,
            "left": lambda x, y, z: x < 1e-9,
            "bottom": lambda x, y, z: y < 1e-9,
        },
    )
    _, model, q = started(
        file,
        law="relaxed",
        regions=(Region(youngs_modulus=E, poisson_ratio=NU, density=1000.0, thickness=1e-4),),
        supports=(
            Support(group="hub", stretch=(1.0 - u0 / a, 1.0 - u0 / a, 1.0)),
            Support(group="rim"),
            Support(group="left", fixed="xz"),
            Support(group="bottom", fixed="yz"),
        ),
    )

    def conditions(unknown):
        c, k, A, B, log_rho = unknown  # lengths over u0, stress over E u0
        rho = np.exp(log_rho)
        u, slope = A * rho + B / rho, A - B / rho**2
        return [
            c * np.log(a) + k + 1.0,
            A * b + B / b,
            c * np.log(rho) + k - u,
            c / rho - (slope + NU * u / rho) / (1.0 - NU**2),
            u / rho + NU * slope,
        ]

    c, k, A, B, log_rho = fsolve(conditions, [0.6, 0.5, -0.5, 0.1, np.log(0.37)], xtol=1e-13)
    rho = np.exp(log_rho)
    assert a < rho < b
    X = file.nodes
    r = np.hypot(X[:, 0], X[:, 1])
    exact = u0 * np.where(r < rho, c * np.log(r) + k, A * r + B / r)
    radial = np.sum(q * X, axis=1) / r
    assert radial == pytest.approx(exact, abs=2e-3 * u0)
    wrinkled = (rho**2 - a**2) / (b**2 - a**2)
    assert model.get("compressed_share") == pytest.approx(wrinkled, abs=0.05)


def volume(nodes, faces):
    """Volume between quadrilaterals, each cut both ways into triangles, and the origin."""
    return sum(
        np.dot(x[i], np.cross(x[j], x[k])) / 12.0
        for x in nodes[faces]
        for i, j, k in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))
    )


def inflated(file, modulus, supports):
    film = Region(youngs_modulus=modulus, poisson_ratio=0.4, density=1000.0, thickness=1e-3)
    load = (Load(name="pressure", start=1000.0),)
    _, model, q = started(file, law="relaxed", regions=(film,), supports=supports, loads=load)
    assert model.get("largest_strain") < 0.012
    return file.nodes + q


def pillow(n):
    """Volume of an inflated square bag with unit sides whose seams draw in; an eighth of it is meshed."""
    edges = {
        "left": lambda x, y, z: x < 1e-9,
        "bottom": lambda x, y, z: y < 1e-9,
        "right": lambda x, y, z: x > 0.5 - 1e-9,
        "top": lambda x, y, z: y > 0.5 - 1e-9,
    }
    held = {"left": "x", "bottom": "y", "right": "z", "top": "z"}
    file = meshed([rectangle(0.5, 0.5)], n, edges=edges)
    x = inflated(file, 1e8, tuple(Support(group=name, fixed=axes) for name, axes in held.items()))
    return 8.0 * volume(x, file.quadrilaterals)


def test_a_square_bag_holds_what_the_teabag_problem_allows():
    """The paper bag problem of a square: between 0.2055 and 0.217 of the cubed side as found by A. Kepert, 0.2017 by the
    formula of A. C. Robin, Mathematics Today, June 2004, 104-107."""
    coarse, fine = pillow(4), pillow(8)
    limit = fine + (fine - coarse) / 3.0  # second order
    assert coarse < fine < limit < 0.217
    assert fine == pytest.approx(0.2017, rel=0.01)
    assert limit == pytest.approx(0.2055, rel=0.01)


def test_an_airbag_rests_where_kratos_finds_it():
    """Of 1.2 m across its corners, 588 MPa, 0.4, 0.6 mm and 5 kPa; ``python -m studies.kratos.airbag`` recorded it."""
    found = at_rest(airbag(16), np.zeros(0), {})
    kratos = np.loadtxt(ORACLES / "kratos/airbag/16.csv", delimiter=",")
    assert kratos[0, 2] == pytest.approx(0.2165, abs=5e-5)
    np.testing.assert_allclose(found, kratos, rtol=0.0, atol=1e-7)


def test_an_inflated_disc_is_the_mylar_balloon():
    """W. H. Paulsen, The American Mathematical Monthly 101(10), 953-958, 1994: a flat radius shrinks by 1.3110, and the
    balloon is 1.1981 times as high as its radius. The circle is a polygon here, and its rim zigzags."""
    a = 0.5
    edges = {"rim": lambda x, y, z: np.hypot(x, y) > a - 1e-9}
    lines = {"x": lambda x, y, z: np.abs(x) < 1e-9, "y": lambda x, y, z: np.abs(y) < 1e-9}
    file = meshed(disc(a), 4, edges=edges, points=lines)
    supports = (Support(group="rim", fixed="z"), Support(group="x", fixed="x"), Support(group="y", fixed="y"))
    x = inflated(file, 4e8, supports)
    radius = np.hypot(x[:, 0], x[:, 1])[np.unique(file.edges["rim"])].mean()
    assert radius == pytest.approx(a / 1.3110, rel=0.01)
    assert 2.0 * x[:, 2].max() == pytest.approx(1.1981 * a / 1.3110, rel=0.012)
