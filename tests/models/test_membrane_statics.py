"""Statics of membranes from a mesh, found by initialization, against closed forms, series and published values."""

import numpy as np
import pytest
from gossamer_models.membrane import (
    Edge,
    Gas,
    Load,
    Region,
    Sensor,
    Setup,
    Support,
    Zone,
    make_structure,
    read_structure,
    surface_mesh,
)
from gossamer_models.membrane.gauges import gauge
from gossamer_models.membrane.portable import structure_text
from gossamer_models.mistakes import DescriptionError
from oracles import axisymmetric
from oracles.meshes import ball, disc, meshed, rectangle, rim, started, tube
from scipy.optimize import brentq, fsolve

E, NU, H = 1e7, 0.3, 1e-3
FILM = Region(youngs_modulus=E, poisson_ratio=NU, density=1000.0, thickness=H)
SIDES = {
    "left": lambda x, y, z: x < 1e-9,
    "right": lambda x, y, z: x > 1.0 - 1e-9,
    "bottom": lambda x, y, z: y < 1e-9,
    "top": lambda x, y, z: y > 1.0 - 1e-9,
} | rim(1.0)
RIM = (Support(group="rim"),)


def square(n, kind="quad", **groups):
    return meshed([rectangle(1.0, 1.0)], n, edges=SIDES, kind=kind, **groups)


def test_point_loads_on_a_prestressed_square_bend_it_as_in_kratos():
    """KratosMultiphysics, StructuralMechanicsApplication, test of a prestressed membrane under point loads."""
    file = meshed([rectangle(4.0, 4.0)], 10, points=rim(4.0) | {"all": lambda x, y, z: x < 9.0})
    film = Region(youngs_modulus=100.0, poisson_ratio=0.3, density=1.0, thickness=1.0, prestress=(100.0, 100.0, 0.0))
    force = Load(name="force", kind="force", groups=("all",), direction=(0.0, 0.0, -1.0), start=80.0)
    structure, _, q = started(file, regions=(film,), supports=RIM, loads=(force,))
    for x, expected in ((2.0, -2.6369332), (1.6, -2.5046271)):
        node = np.argmin(np.hypot(structure.mesh.nodes[:, 0] - x, structure.mesh.nodes[:, 1] - 2.0))
        assert q[node, 2] == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_a_force_at_a_point_has_its_resultant_there_and_spread_over_a_radius_is_a_pressure(kind):
    """The deflection of a drum under a load on a disc in its middle is (F/(4 pi T)) (1 + 2 ln(R/a)), T its tension."""
    place = (0.61, 0.43, 0.0)
    file = square(16, kind)
    for radius, near in ((0.0, 1e-12), (0.02, 2e-3), (0.15, 2e-3)):
        load = Load(name="hit", kind="force", point=place, radius=radius, direction=(0.0, 0.0, 2.0))
        setup = Setup(regions=(FILM,), supports=RIM, loads=(load,))
        structure = make_structure(setup, surface_mesh(file, 1))
        force = structure.unit_forces["hit"].reshape(-1, 3)
        np.testing.assert_allclose(force.sum(axis=0), (0.0, 0.0, 1.0), atol=1e-12)
        np.testing.assert_allclose(force[:, 2] @ structure.mesh.nodes, place, atol=near)
        again = read_structure(structure_text(structure))
        np.testing.assert_array_equal(again.unit_forces["hit"], structure.unit_forces["hit"])
    R, a, T = 1.0, 0.2, 1e5 * H
    film = Region(youngs_modulus=E, poisson_ratio=NU, density=1000.0, thickness=H, prestress=(T / H, T / H, 0.0))
    load = Load(name="hit", kind="force", point=(0.0, 0.0, 0.0), radius=a, start=0.1)
    drum = meshed(disc(R), 24, edges={"rim": lambda x, y, z: np.hypot(x, y) > R - 1e-9}, kind=kind)
    w = started(drum, regions=(film,), supports=RIM, loads=(load,))[2][:, 2].max()
    assert w == pytest.approx(0.1 / (4.0 * np.pi * T) * (1.0 + 2.0 * np.log(R / a)), rel=0.02)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "force"}, "needs 'groups', those of nodes"),
        ({"kind": "force", "groups": ("rim",), "point": (0.5, 0.5, 0.0)}, "Write one of them"),
        ({"point": (0.5, 0.5, 0.0)}, "'point' belongs to a force at a point"),
        ({"kind": "force", "groups": ("rim",), "radius": 0.1}, "'radius' belongs to a force at a point"),
        ({"kind": "force", "point": (0.5, 0.5, 0.2)}, "away from the surface by 0.2 m"),
    ],
)
def test_a_force_that_has_no_place_or_two_is_refused(wrong, message):
    with pytest.raises(DescriptionError, match=message):
        make_structure(Setup(regions=(FILM,), supports=RIM, loads=(Load(name="hit", **wrong),)), surface_mesh(square(4), 1))


@pytest.mark.parametrize(
    ("stress", "pressure", "n"), [(1e4, 1e-6, 8), (1e6, 1e-4, 8), (1e3, 9e-6, 8), (1e4, 1e-6, 16), (1e3, 1e-8, 16)]
)
def test_a_soft_film_under_a_small_load_deflects_as_in_closed_form(stress, pressure, n):
    """Such films began with 0.24 to 0.33 of it, where forces that round in the stiff plane were taken for an equilibrium.

    Prestress alone: 0.07367 p L^2/(S h), a Fourier series. With what the film stretches: D. Maier-Schneider, J. Maibach,
    E. Obermeier, Journal of Microelectromechanical Systems 4(4), 238-241, 1995, doi:10.1109/84.475551, good to 3 %.
    """
    L, h, modulus, nu = 10.0, 2.5e-6, 2.5e9, 0.34
    film = Region(youngs_modulus=modulus, poisson_ratio=nu, density=1400.0, thickness=h, prestress=(stress, stress, 0.0))
    file, load = meshed([rectangle(L, L)], n, points=rim(L)), Load(name="pressure", start=pressure)
    w = started(file, regions=(film,), supports=RIM, loads=(load,))[2][:, 2].max()
    linear, stiffening = (3.45 * stress * h / (L / 2) ** 2, 1.994 * (1 - 0.271 * nu) / (1 - nu) * modulus * h / (L / 2) ** 4)
    assert w == pytest.approx(brentq(lambda x: linear * x + stiffening * x**3 - pressure, 0.0, 1.0), rel=0.03)
    if (stress, pressure) != (1e3, 9e-6):  # it stretches by next to nothing
        assert w == pytest.approx(0.0736713 * pressure * L**2 / (stress * h), rel=0.015)


def hencky(load, poisson_ratio):
    """Return the deflection over the radius of a disc under p a/(E h): H. Hencky, Zeitschrift fuer Mathematik und Physik 63,
    311-317, 1915, for small slopes. The radial force over E h is the series of b_n r^2n, r from 0 to 1."""

    def series(b0):
        b, inverse = [b0], [1.0 / b0]
        for n in range(1, 40):
            square = sum(inverse[k] * inverse[n - 1 - k] for k in range(n))
            b.append(-(load**2) * square / (8.0 * 2 * n * (2 * n + 2)))
            inverse.append(-sum(b[k] * inverse[n - k] for k in range(1, n + 1)) / b0)
        return np.array(b), np.array(inverse)

    n = np.arange(40)
    size = load ** (2.0 / 3.0)
    b0 = brentq(lambda b0: series(b0)[0] @ (2 * n + 1 - poisson_ratio), 0.3 * size, size)
    return load / 2.0 * series(b0)[1] @ (1.0 / (2 * n + 2))


def test_a_disc_under_pressure_bulges_as_henckys_series_beside_its_slope():
    """14.357 mm at 0.5 kPa by the series; the rest grows with the square of the slope, which the series neglects."""
    a, h, modulus, nu = 0.07, 0.3e-3, 3.05e6, 0.45
    file = meshed(disc(a), 2, edges={"rim": lambda x, y, z: np.hypot(x, y) > a - 1e-9}, kind="quad9")
    film = Region(youngs_modulus=modulus, poisson_ratio=nu, density=1000.0, thickness=h)

    def deflection(pressure):
        load = Load(name="pressure", start=pressure)
        return started(file, order=3, regions=(film,), supports=RIM, loads=(load,))[2][:, 2].max()

    pressures = 500.0 / 1.5 ** np.array([0.0, 3.0, 6.0])  # slopes, which go with the cube root, by factors of 1.5
    w = np.array([deflection(p) for p in pressures])
    assert w[0] == pytest.approx(14.357e-3, rel=0.015)
    beyond = w / a / [hencky(p * a / (modulus * h), nu) for p in pressures] - 1.0
    assert 0.004 < beyond[0] < 0.012
    first, second = -np.diff(beyond)  # without the error of the mesh, which is the same at every load
    assert first / second == pytest.approx(1.5**2, rel=0.1)


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "hencky", "neo_hookean"])
def test_a_disc_of_each_law_bulges_as_its_meridian_does_by_differential_equations(law):
    """By 0.46 to 0.59 of its radius, where laws differ by a quarter of that."""
    a, h, modulus, nu, p = 0.07, 0.3e-3, 3.05e6, 0.45, 5e3
    tensions = getattr(axisymmetric, law)
    S, (r, z) = axisymmetric.disc(a, p, lambda l1, l2: h * tensions(l1, l2, modulus, nu))
    film = Region(youngs_modulus=modulus, poisson_ratio=nu, density=1000.0, thickness=h)
    file = meshed(disc(a), 2, edges={"rim": lambda x, y, z: np.hypot(x, y) > a - 1e-9}, kind="quad9")
    load = Load(name="pressure", start=p)
    structure, _, q = started(file, law=law, order=3, regions=(film,), supports=RIM, loads=(load,))
    R, x = np.hypot(*structure.mesh.nodes[:, :2].T), structure.mesh.nodes + q
    np.testing.assert_allclose(x[:, 2], np.interp(R, S, z), atol=1e-3 * z[0])
    np.testing.assert_allclose(np.hypot(*x[:, :2].T), np.interp(R, S, r), atol=4e-4 * a)


def test_a_torus_under_pressure_grows_as_its_meridian_does_by_differential_equations():
    ring, section, p, modulus, nu, h = 3.0, 0.25, 700.0, 3e9, 0.3, 5e-5

    def quarter(s, t):  # of its upper half, from the outer equator to the inner one
        around, along = np.pi / 2.0 * s, np.pi * t
        r = ring + section * np.cos(along)
        return r * np.cos(around), r * np.sin(around), section * np.sin(along)

    planes = {axis: lambda *X, k=k: np.abs(X[k]) < 1e-9 for k, axis in enumerate("xyz")}
    structure, _, q = started(
        meshed([quarter], (8, 24), edges=planes, kind="quad9"),
        order=3,
        regions=(Region(youngs_modulus=modulus, poisson_ratio=nu, density=1400.0, thickness=h),),
        supports=tuple(Support(group=axis, fixed=axis) for axis in "xyz"),
        loads=(Load(name="pressure", start=p),),
    )
    tensions = axisymmetric.st_venant_kirchhoff
    S, (r, _) = axisymmetric.torus(ring, section, p, lambda l1, l2: h * tensions(l1, l2, modulus, nu))
    grown = r - ring - section * np.cos(S / section)
    X = structure.mesh.nodes
    R = np.hypot(X[:, 0], X[:, 1])
    found = np.hypot(*(X + q)[:, :2].T) - R
    expected = np.interp(section * np.arctan2(X[:, 2], R - ring), S, grown)
    np.testing.assert_allclose(found, expected, atol=5e-4 * grown.max())


def inflated_tube(n, kind, order, load="pressure"):
    """Errors of radius and length of a tube under pressure with a line tension at its end; those of a membrane are exact."""
    radius, length, p, tension = 0.5, 1.0, 1e3, 400.0
    D = E * H / (1.0 - NU**2)

    def balance(stretch):
        hoop, axial = (stretch**2 - 1.0) / 2.0
        pushed = p * radius * (np.prod(stretch) if load == "pressure" else 1.0)  # on the current area or on the reference's
        return [D * (hoop + NU * axial) * stretch[0] - pushed, D * (axial + NU * hoop) * stretch[1] - tension]

    around, along = fsolve(balance, [1.04, 1.02], xtol=1e-13)
    lines = {
        "x0": lambda x, y, z: np.abs(x) < 1e-9,
        "y0": lambda x, y, z: np.abs(y) < 1e-9,
        "bottom": lambda x, y, z: z < 1e-9,
        "top": lambda x, y, z: z > length - 1e-9,
    }
    structure, _, q = started(
        meshed([tube(radius, length)], n, edges=lines, kind=kind),
        order=order,
        regions=(FILM,),
        supports=(Support(group="x0", fixed="x"), Support(group="y0", fixed="y"), Support(group="bottom", fixed="z")),
        edges=(Edge(group="top", tension=tension),),
        loads=(Load(name="pressure", kind=load, start=p),),
    )
    x = structure.mesh.nodes + q
    return max(np.abs(np.hypot(x[:, 0], x[:, 1]) / (radius * around) - 1.0).max(), abs(x[:, 2].max() / length - along))


def test_a_tube_under_pressure_and_tension_carries_hoop_and_axial_stress():
    errors = [inflated_tube((n, 2), "quad", 1) for n in (16, 32)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.05)
    errors = [inflated_tube((n, 1), "quad9", 4) for n in (16, 32)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.1, abs=0.2)  # the file's surface is quadratic
    assert inflated_tube((40, 1), "quad9", 4) < 1e-6


def test_a_dead_pressure_keeps_direction_and_area_of_the_reference_shape():
    assert inflated_tube((16, 1), "quad9", 4, "dead_pressure") < 5e-5


@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_a_balloon_obeys_the_gas_law(exponent):
    """To rounding by its own volume, and near the closed form of a sphere by its radius."""
    radius, p, ambient, amount = 0.5, 200.0, 1e3, 1.3
    axes = {axis: (lambda x, y, z, i=i: np.abs((x, y, z)[i]) > radius - 1e-9) for i, axis in enumerate("xyz")}
    _structure, model, _ = started(
        meshed(ball(radius), 2, points=axes, kind="quad9"),
        order=2,
        mass_damping=200.0,
        regions=(Region(youngs_modulus=1e6, poisson_ratio=NU, density=1000.0, thickness=H),),
        supports=tuple(Support(group=axis, fixed="xyz".replace(axis, "")) for axis in axes),
        loads=(),
        gas=Gas(pressure=p, ambient=ambient, exponent=exponent),
    )
    before = model.get("volume")
    assert model.get("gas_pressure") == p
    model.set("gas_amount", amount)
    for _ in range(600):
        model.step(1e-3)
    filled = (p + ambient) * amount * (before / model.get("volume")) ** exponent - ambient
    assert model.get("gas_pressure") == pytest.approx(filled, rel=1e-10)

    def tension(stretch):
        return 1e6 * H / (1.0 - NU) * (stretch**2 - 1.0) / 2.0

    start = brentq(lambda k: p * radius * k - 2.0 * tension(k), 1.0, 1.5)
    end = brentq(
        lambda k: ((p + ambient) * amount * (start / k) ** (3.0 * exponent) - ambient) * radius * k - 2.0 * tension(k),
        1.0,
        1.5,
    )
    assert (model.get("volume") / before) ** (1.0 / 3.0) == pytest.approx(end / start, rel=2e-3)


def test_a_film_that_cools_shrinks_where_free_and_is_stressed_where_held():
    expansion, cold = 2e-5, -100.0
    film = Region(youngs_modulus=E, poisson_ratio=NU, density=1e3, thickness=H, thermal_expansion=expansion)
    gauge = (Sensor(point=(0.4, 0.6, 0.0), direction=(1.0, 0.0, 0.0)),)
    free = (Support(group="left", fixed="xz"), Support(group="bottom", fixed="yz"), Support(group="rim", fixed="z"))
    _, model, _ = started(square(2), regions=(film,), supports=free, sensors=gauge)
    model.reset()
    model.set("temperature[1]", cold)
    model.initialize()
    assert model.get("strain[1]") == pytest.approx(np.sqrt(1.0 + 2.0 * expansion * cold) - 1.0, rel=1e-9)

    a, p = 0.5, 1e-3
    file = meshed(disc(a), 2, edges={"rim": lambda x, y, z: np.hypot(x, y) > a - 1e-9}, kind="quad9")
    _, model, _ = started(file, order=4, regions=(film,), supports=RIM)
    model.reset()
    model.set("temperature[1]", cold)
    model.set("pressure", p)
    model.initialize()
    tension = H * E * expansion * -cold / (1.0 - NU)
    assert model.get("displacement") == pytest.approx(p * a**2 / (4.0 * tension), rel=2e-3)


@pytest.mark.parametrize("order", [1, 3])
def test_zones_with_temperatures_of_their_own_lengthen_a_free_strip_each_by_its_own(order):
    """Two halves of one region, one behind the other; that of the region adds up with theirs. Exact."""
    expansion, of_region, of_zones = 2e-5, 30.0, (100.0, -40.0)
    film = Region(youngs_modulus=E, poisson_ratio=0.0, density=1e3, thickness=H, thermal_expansion=expansion)
    halves = {"near": lambda x, y, z: x < 0.5, "far": lambda x, y, z: x > 0.5}
    held = Support(group="left", fixed="xyz"), Support(group="all", fixed="yz")
    groups = {"faces": halves, "points": {"all": lambda x, y, z: x < 9.0}}
    setup = {"regions": (film,), "supports": held, "zones": tuple(Zone(group=name) for name in halves), "order": order}
    structure, model, _ = started(square(4, "quad" if order == 1 else "quad9", **groups), **setup)
    rows = [v for v in structure.table if "temperature" in v.name]
    assert [v.name for v in rows] == ["temperature[1]", "zone_temperature[1]", "zone_temperature[2]"]
    model.reset()
    for v, value in zip(rows, (of_region, *of_zones), strict=True):
        model.set(v.name, value)
    model.initialize()
    at = structure.mesh.nodes[structure.moving, 0]
    x = at + model.x[: 3 * len(at) : 3]
    near, far = (np.sqrt(1.0 + 2.0 * expansion * (of_region + value)) for value in of_zones)
    assert x == pytest.approx(near * np.minimum(at, 0.5) + far * np.maximum(at - 0.5, 0.0), abs=1e-11)


def test_a_strip_under_edge_tension_carries_uniaxial_stress():
    tension = 300.0
    held = (Support(group="left", fixed="xz"), Support(group="bottom", fixed="y"), Support(group="right", fixed="z"))
    for kind, order in (("quad", 1), ("triangle", 1), ("quad9", 3)):
        structure, _, q = started(
            square(2, kind), order=order, regions=(FILM,), supports=held, edges=(Edge(group="right", tension=tension),)
        )
        stretch = brentq(lambda k: E * H * (k**2 - 1.0) / 2.0 * k - tension, 1.0, 1.1)
        assert structure.mesh.nodes[:, 0] + q[:, 0] == pytest.approx(structure.mesh.nodes[:, 0] * stretch, abs=1e-9)


def plate_of_basilisk(u, n, mirrored, scattered):
    """Return force over area and pressure [1] of a facet that light along u meets from the side of its normal n.

    Basilisk 2.12, facetSRPDynamicEffector: F = -P A cos t [(1 - mirrored) s + 2 (scattered / 3 + mirrored cos t) n], where
    s points to the Sun. Its program gives the same to 1e-15 for the shares below; it is not run here.
    """
    s, cosine = -u, -u @ n
    return -cosine * ((1.0 - mirrored) * s + 2.0 * (scattered / 3.0 + mirrored * cosine) * n)


def plate_of_mcinnes(u, n, mirrored, scattered, lit, dark):
    """Return the same of a plate whose sides, the one that is lit and the other, have these emissivities.

    C. R. McInnes, Solar Sailing, Springer, 1999, Section 2.6, with B = 2/3: r s is ``mirrored``, r (1 - s) ``scattered``.
    """
    cosine, absorbed = -u @ n, 1.0 - mirrored - scattered
    normal = (1.0 + mirrored) * cosine**2 + 2.0 / 3.0 * scattered * cosine
    normal += 2.0 / 3.0 * absorbed * (lit - dark) / (lit + dark) * cosine
    return normal * -n + (1.0 - mirrored) * cosine * (u + cosine * n)


def pushed(lights, **given):
    """Return the velocity over time of the nodes that lights give a flat plate at rest [m/s2], shape (n, 3)."""
    structure, model, _ = started(square(4), regions=(FILM,), supports=RIM, loads=lights)
    for name, value in given.items():
        model.set(name, value)
    model.step(1e-6)
    return 1e6 * model.x[3 * len(structure.moving) : 6 * len(structure.moving)].reshape(-1, 3)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("mirrored", "scattered"), [(0.0, 0.0), (1.0, 0.0), (0.9, 0.0), (0.5, 0.3), (0.0, 1.0)])
def test_sun_and_albedo_push_a_flat_plate_as_facets_of_basilisk_and_of_mcinnes_are_pushed(side, mirrored, scattered):
    """From both sides, whatever the length of the direction, the Sun partly in eclipse. Asked: 1e-6."""
    n = np.array([0.0, 0.0, -side])
    u, v = np.array([np.sin(0.6), 0.0, side * np.cos(0.6)]), np.array([-0.2, 0.4, side * np.sqrt(0.8)])
    sun = Load(name="sun", kind="light", direction=tuple(0.5 * u), reflectivity=mirrored, diffuse=scattered)
    albedo = Load(name="albedo", kind="light", direction=tuple(v), reflectivity=0.2, diffuse=0.1, emissivity=(0.1, 0.8))
    found = pushed((sun, albedo), sun=9.1e-3, albedo=3e-3, sun_eclipse=0.25)
    of_sun = plate_of_basilisk(u, n, mirrored, scattered)
    assert of_sun == pytest.approx(plate_of_mcinnes(u, n, mirrored, scattered, 1.0, 1.0), abs=1e-15)
    of_earth = plate_of_mcinnes(v, n, 0.2, 0.1, *((0.8, 0.1) if side > 0.0 else (0.1, 0.8)))
    expected = (0.75 * 9.1e-3 * of_sun + 3e-3 * of_earth) / (1000.0 * H)
    assert found == pytest.approx(np.tile(expected, (len(found), 1)), rel=1e-6, abs=1e-6 * np.abs(expected).max())


def test_a_plate_that_radiates_to_one_side_is_pushed_away_from_it_whichever_side_is_lit():
    for side in (1.0, -1.0):
        light = Load(name="sun", kind="light", direction=(0.0, 0.0, side), emissivity=(1.0, 0.0))
        assert pushed((light,), sun=1e-2)[:, 2] == pytest.approx(1e-2 * (side - 2.0 / 3.0) / (1000.0 * H), rel=1e-6)


def test_a_gauge_with_a_length_reads_the_mean_of_the_strain_along_it():
    """In a linear strain field, and across the border of elements of triangles, where strain jumps."""
    mesh = surface_mesh(square(3, "quad9"), 2)
    X = mesh.nodes
    x = np.column_stack([X[:, 0] + 0.05 * X[:, 0] ** 2, X[:, 1], X[:, 2]])  # strain 0.1 X
    for length in (0.0, 0.25, 0.5):
        found = gauge(mesh, np.array([0.4, 0.35, 0.0]), np.array([2.0, 0.0, 0.0]), length)
        assert found.away < 1e-12
        read = found.weights @ np.linalg.norm(found.lines @ x, axis=1) - 1.0
        assert read == pytest.approx(0.04, abs=1e-12)
