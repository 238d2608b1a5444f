"""What a membrane on a mesh is made of, held by and loaded with: the tables of ``setup.toml``.

Every class is one table; ``docs/setup.md`` describes the keys. Groups are those of the mesh file. Vectors are in the axes
of the mesh.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement
from typing import Literal, TypeAlias

import numpy as np

from ..arrays import Matrix, Vector
from ..mistakes import Mistake, no_direction, not_finite, outside, raise_any
from .law import LAWS
from .lines import Beam, Cable, Line, PointMass
from .zones import ZERO, Triple, Zone

Place: TypeAlias = tuple[float, float]
BLACK = (1.0, 1.0)  # emissivities that push nowhere
LEFT = ("left_along", "left_across")  # inputs: shares of the stiffness of each zone along its region's axes
# variables that a membrane has beside loads and motions
RESERVED = {
    *("youngs_modulus", "support_stiffness", "mass_damping", "pressure_amplitude", "pressure_frequency", "pressure_phase"),
    *("base_acceleration", "gas_amount", "temperature", "zone_temperature", "damage", "strain", "displacement", "volume"),
    *("gas_pressure", "node", "largest_strain", "displacement_ratio", "compressed_share", "max_step", *LEFT),
}


MAX_ORDER = 12
MOST_REFINED = 5
SCALABLE = ("thickness", "density", "prestress", "tension")
SPRINGS = "support_stiffness"  # parameters of supports that are springs
HOOKEAN = 1e-3  # prestress over Young's modulus up to which every law is Hooke's within a few parts in a thousand


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """Material and thickness of some faces.

    Attributes
    ----------
    group : str
        Group of faces; empty for all that no other region holds.
    youngs_modulus, poisson_ratio, density, thickness : float
        Of the unstretched material [Pa], [1], [kg/m3], [m].
    prestress : tuple of float
        Second Piola-Kirchhoff stress [Pa] of the reference shape: along ``direction``, across, shear.
    direction : tuple of float
        Projected on the surface, the first axis of ``prestress``.
    thermal_expansion : float
        Strain per rise of temperature [1/K]; with it the membrane has the inputs ``temperature`` and ``zone_temperature``.
    """

    youngs_modulus: float
    poisson_ratio: float
    density: float
    thickness: float
    group: str = ""
    prestress: Triple = ZERO
    direction: Triple = (1.0, 0.0, 0.0)
    thermal_expansion: float = 0.0

    def __post_init__(self) -> None:
        limits = {
            "youngs_modulus": (1.0, 1e13),
            "poisson_ratio": (-0.9, 0.499),
            "density": (1e-3, 1e5),
            "thickness": (1e-7, 1.0),
            "thermal_expansion": (-1.0, 1.0),
        }
        raise_any([*outside(self, **limits), *not_finite(self, "prestress"), *no_direction(self, "direction")])

    @property
    def prestrain(self) -> float:
        """Largest prestress over Young's modulus [1]."""
        return max(map(abs, self.prestress)) / self.youngs_modulus


@dataclass(frozen=True, slots=True, kw_only=True)
class Support:
    """Nodes that are held, or drawn to their place by springs.

    Attributes
    ----------
    group : str
        Group of points, edges or faces.
    fixed : str
        The directions, some of x, y and z.
    displacement : tuple of float
        Where the nodes are moved [m] before they are held; beside it what ``stretch`` moves.
    stretch : tuple of float
        Factors [1] of the distance from ``centre`` along x, y and z.
    centre : tuple of float
        A point [m].
    motion : str
        Name of an input that multiplies the way; it starts at 1. Without a name the way stays.
    stiffness : float
        Of springs along the directions of ``fixed`` [N/m], of all nodes together, shared by their masses; 0 for a rigid
        hold.
    """

    group: str
    fixed: str = "xyz"
    displacement: Triple = ZERO
    stretch: Triple = (1.0, 1.0, 1.0)
    centre: Triple = ZERO
    motion: str = ""
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        mistakes = [*not_finite(self, "displacement", "stretch", "centre"), *outside(self, stiffness=(0.0, 1e12))]
        if not self.fixed or set(self.fixed) - set("xyz") or len(set(self.fixed)) < len(self.fixed):
            text = f'\'fixed\' is {self.fixed!r}. Write the directions that are held, for instance "xyz" or "z".'
            mistakes.append(Mistake(("fixed",), text))
        else:
            moved = [d != 0.0 or s != 1.0 for d, s in zip(self.displacement, self.stretch, strict=True)]
            lost = [axis for axis, moves in zip("xyz", moved, strict=True) if moves and axis not in self.fixed]
            if self.displacement != ZERO and lost and any(self.displacement["xyz".index(axis)] for axis in lost):
                text = f"'displacement' moves along {lost[0]}, which 'fixed' = {self.fixed!r} does not hold. Add it there."
                mistakes.append(Mistake(("displacement",), text))
            if self.motion and not any(moved):
                text = "'motion' multiplies the way of the nodes, and there is none. Write 'displacement' or 'stretch'."
                mistakes.append(Mistake(("motion",), text))
        if self.motion and not self.motion.isidentifier():
            text = f"'motion' is {self.motion!r}. Use letters, digits and underscores, and no digit at the start."
            mistakes.append(Mistake(("motion",), text))
        if self.motion and self.stiffness:
            text = "an input moves rigid supports alone. Leave out 'motion', or 'stiffness'."
            mistakes.append(Mistake(("motion",), text))
        raise_any(mistakes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """Tension along a free edge.

    Attributes
    ----------
    group : str
        Group of edges.
    tension : float
        Dead load per reference length [N/m], in the surface, across the edge and outward.
    """

    group: str
    tension: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A load that an input changes while the membrane moves.

    Attributes
    ----------
    name : str
        Name of the input.
    kind : {"pressure", "dead_pressure", "light", "force", "centrifugal"}
        Pressure [Pa] along the normal as the surface turns, or along that of the reference shape. Light: pressure [Pa] of
        light that is wholly absorbed; its direction of travel is the input ``<name>_direction``, its share [1] in shadow
        ``<name>_eclipse``. Force [N] on every node of groups, or in all at a point. Centrifugal: rate of turn [rad/s].
    groups : tuple of str
        Groups of faces, or of nodes for forces; empty for all faces.
    start : float
        Start value of the input.
    direction : tuple of float
        Of a force, of the axis of a centrifugal load, or where light travels to at the start.
    reflectivity, diffuse : float
        Shares of the light [1] that are mirrored and scattered evenly; the rest is absorbed.
    emissivity : tuple of float
        Of the side that the normal of the surface is on, and of the other [1]: they share the heat of absorbed light.
    point : tuple of float or None
        Where a force acts [m], in place of groups; of the axis of a centrifugal load, None for the origin.
    radius : float
        It is spread evenly over the surface this far around the point [m].
    """

    name: str
    kind: Literal["pressure", "dead_pressure", "light", "force", "centrifugal"] = "pressure"
    groups: tuple[str, ...] = ()
    start: float = 0.0
    direction: Triple = (0.0, 0.0, 1.0)
    reflectivity: float = 0.0
    diffuse: float = 0.0
    emissivity: tuple[float, float] = BLACK
    point: Triple | None = None
    radius: float = 0.0

    def __post_init__(self) -> None:
        shares = {"reflectivity": (0.0, 1.0), "diffuse": (0.0, 1.0)}
        mistakes = [*outside(self, start=(-1e6, 1e6), **shares), *no_direction(self, "direction")]
        mistakes += [*outside(self, radius=(0.0, 1e3)), *(not_finite(self, "point") if self.point else ())]
        if not self.name.isidentifier():
            text = f"'name' is {self.name!r}. Use letters, digits and underscores, and no digit at the start."
            mistakes.append(Mistake(("name",), text))
        if self.kind == "force" and bool(self.groups) == (self.point is not None):
            text = "a force needs 'groups', those of nodes that it acts on, or a 'point'. Write one of them."
            mistakes.append(Mistake(("groups",), text))
        if self.reflectivity + self.diffuse > 1.0:
            text = f"'reflectivity' and 'diffuse' are {self.reflectivity + self.diffuse:g} together. Write shares of 1."
            mistakes.append(Mistake(("diffuse",), text))
        if not (all(0.0 <= e <= 1.0 for e in self.emissivity) and any(self.emissivity)):
            text = f"'emissivity' is {list(self.emissivity)}. Write two numbers from 0 to 1, not 0 both."
            mistakes.append(Mistake(("emissivity",), text))
        optical = {name: getattr(self, name) != 0.0 for name in shares} | {"emissivity": self.emissivity != BLACK}
        wrong = {name: (there and self.kind != "light", "light") for name, there in optical.items()}
        of_points = "a force at a point or the axis of a centrifugal load"
        wrong["point"] = self.point is not None and self.kind not in ("force", "centrifugal"), of_points
        wrong["radius"] = self.radius > 0.0 and (self.kind != "force" or self.point is None), "a force at a point"
        wrong["groups"] = bool(self.groups) and self.kind == "centrifugal", "loads that do not act on all masses"
        misplaced = ((name, owner) for name, (there, owner) in wrong.items() if there)
        mistakes += [Mistake((name,), f"{name!r} belongs to {owner}. Leave it out.") for name, owner in misplaced]
        raise_any(mistakes)

    @property
    def glows(self) -> bool:
        """Whether what is scattered or radiated pushes."""
        return self.diffuse > 0.0 or self.emissivity[0] != self.emissivity[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gas:
    """Gas that the surface encloses; its pressure follows from its volume.

    Attributes
    ----------
    groups : tuple of str
        Groups of faces that move its volume; empty for all.
    pressure : float
        Over the ambient one, in the shape from which the membrane starts [Pa].
    ambient : float
        Pressure outside [Pa]; 0 in space.
    exponent : float
        1 isothermal, 1.4 adiabatic for air.
    volume : float or None
        In the shape from which the membrane starts [m3]; needed where the faces are open, whose border must be held then.
    """

    pressure: float
    groups: tuple[str, ...] = ()
    ambient: float = 0.0
    exponent: float = 1.0
    volume: float | None = None

    def __post_init__(self) -> None:
        limits = {"pressure": (-1e6, 1e6), "ambient": (0.0, 1e7), "exponent": (1.0, 2.0)}
        mistakes = [*outside(self, **limits)]
        if self.volume is not None and not 0.0 < self.volume < math.inf:
            mistakes.append(Mistake(("volume",), f"'volume' is {self.volume:g} m3. Write a positive volume."))
        if self.pressure + self.ambient <= 0.0:
            text = "'pressure' and 'ambient' together must be above 0 Pa, for else there is no gas."
            mistakes.append(Mistake(("pressure",), text))
        raise_any(mistakes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A strain gauge.

    Attributes
    ----------
    point : tuple of float
        Its middle on the reference shape [m].
    direction : tuple of float
        Projected on the surface, what it measures along.
    gauge_length : float
        It reads the mean strain over this length [m]; 0 at the point.
    line : str
        Name of the cable or beam that it is on, whose length it measures.
    """

    point: Triple
    direction: Triple
    gauge_length: float = 0.0
    line: str = ""

    def __post_init__(self) -> None:
        mistakes = [*outside(self, gauge_length=(0.0, 1e3)), *not_finite(self, "point")]
        raise_any([*mistakes, *no_direction(self, "direction")])


@dataclass(frozen=True, slots=True, kw_only=True)
class Paraboloid:
    """A paraboloid of revolution that some faces are to form, as the reflector of an antenna.

    Attributes
    ----------
    name : str
        Of its outputs ``<name>_rms``, ``<name>_focal_shift`` and ``<name>_pointing``.
    focal_length : float
        As drawn [m].
    groups : tuple of str
        Groups of faces; empty for all.
    vertex : tuple of float
        Where its axis meets it, as drawn [m].
    axis : tuple of float
        From the vertex to the focus, as drawn.
    """

    name: str
    focal_length: float
    groups: tuple[str, ...] = ()
    vertex: Triple = ZERO
    axis: Triple = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        mistakes = [*outside(self, focal_length=(1e-6, 1e6)), *not_finite(self, "vertex"), *no_direction(self, "axis")]
        if not self.name.isidentifier():
            text = f"'name' is {self.name!r}. Use letters, digits and underscores, and no digit at the start."
            mistakes.append(Mistake(("name",), text))
        raise_any(mistakes)

    @property
    def outputs(self) -> tuple[str, str, str]:
        """Names of its outputs."""
        return f"{self.name}_rms", f"{self.name}_focal_shift", f"{self.name}_pointing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that may go wrong beside damage of zones, which a twin weighs as an explanation like damage.

    Attributes
    ----------
    name : str
        What it is called in answers.
    parameter : str
        Parameter or input of the model that changes, or an array of them, such as ``gas_amount``, ``tension_factor``,
        ``support_stiffness[2]``; or ``sensor[3]``, the reading of a sensor.
    change : {"falls", "rises"}
        To less or more than it should be, by an unknown share.
    most : float
        Largest share [1].
    probability : float
        How likely it is at an inspection beforehand [1].
    """

    name: str
    parameter: str
    change: Literal["falls", "rises"] = "falls"
    most: float = 0.95
    probability: float = 0.01

    def __post_init__(self) -> None:
        mistakes = [*outside(self, most=(1e-3, 0.95), probability=(1e-9, 0.5))]
        if self.change not in ("falls", "rises"):
            mistakes.append(Mistake(("change",), f'\'change\' is {self.change!r}. Write "falls" or "rises".'))
        raise_any(mistakes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Built:
    """How far the shape that was built is from the mesh, along its normal, as ``gossamer calibrate --survey`` finds it.

    Attributes
    ----------
    centre : tuple of float
        Where the coordinates are 0 [m].
    size : float
        Length over which they change by 2 [m].
    coefficients : tuple of float
        Of monomials in them [m]: 1, x, y, z, xx, xy, xz, yy, yz, zz, xxx, ..., up to a whole degree.
    """

    centre: Triple
    size: float
    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        mistakes = [*outside(self, size=(1e-6, 1e6)), *not_finite(self, "centre", "coefficients")]
        if len(self.coefficients) not in (of_degree := [math.comb(degree + 3, 3) for degree in range(9)]):
            text = f"there are {len(self.coefficients)} 'coefficients'. Polynomials have {', '.join(map(str, of_degree))}."
            mistakes.append(Mistake(("coefficients",), text))
        raise_any(mistakes)

    def coordinates(self, X: Matrix) -> Matrix:
        """Return the coordinates of places [m], shape (n, 3)."""
        return np.asarray(2.0 * (X - np.array(self.centre)) / self.size)

    def deviation(self, X: Matrix) -> Vector:
        """Return the deviation at places of the drawing [m], shape (n,)."""
        degree = next(d for d in range(9) if math.comb(d + 3, 3) == len(self.coefficients))
        return np.asarray(monomials(self.coordinates(X), degree) @ np.array(self.coefficients))


def monomials(x: Matrix, degree: int) -> Matrix:
    """Return all products of up to so many coordinates, shape (n, 3), shape (n, products)."""
    ways = [way for d in range(degree + 1) for way in combinations_with_replacement(range(3), d)]
    return np.column_stack([np.prod(x[:, list(way)], axis=1) for way in ways])


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownNumbers:
    """What healthy records told of the membrane, as ``gossamer calibrate`` writes it.

    Attributes
    ----------
    names : tuple of str, length k
        Numbers that were fitted, see ``twin.nuisances``, and gains and places of all sensors or of none.
    covariance : tuple of tuple of float, shape (k, k)
        Of the logarithms of numbers, of gains, and of places [m].
    parameters : mapping of str to float
        Parameters of the model that have these values.
    gains : tuple of float
        Readings over right readings of the sensors [1].
    places : tuple of tuple of float
        How far the sensors are off their points, along their directions and across [m]; none if there they are.
    drawing : str
        Digest of the drawing that it is of.
    """

    names: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...]
    parameters: Mapping[str, float] = field(hash=False)
    drawing: str
    gains: tuple[float, ...] = ()
    places: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        k = len(self.names)
        gains = sum(name.startswith("gain[") for name in self.names)
        if len(self.gains) not in (0, gains):
            text = f"there are {len(self.gains)} gains, and 'names' has {gains} of them. Calibrate again."
            raise_any([Mistake(("gains",), text)])
        if [len(row) for row in self.covariance] != [k] * k:
            text = f"'covariance' is no table of {k} by {k} numbers, one for each of 'names'. Calibrate again."
            raise_any([Mistake(("covariance",), text)])
        if not np.linalg.eigvalsh(np.reshape(self.covariance, (k, k))).min(initial=1.0) > 0.0:
            text = "'covariance' is none: it has no positive variance in every direction. Calibrate again."
            raise_any([Mistake(("covariance",), text)])

    @property
    def of_structure(self) -> "KnownNumbers":
        """The same without gains, and with known places: of what simulates the structure, as its readings are."""
        at = [k for k, name in enumerate(self.names) if not name.startswith(("gain[", "place_"))]
        covariance = tuple(tuple(self.covariance[i][k] for k in at) for i in at)
        return replace(self, names=tuple(self.names[k] for k in at), covariance=covariance, gains=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A membrane on a mesh.

    Attributes
    ----------
    title : str
        One line.
    mesh : str
        Mesh file, relative to this file.
    scale : float
        Length of the mesh file's unit [m].
    order : int
        Of the quadrilaterals: 1 for bilinear elements, 2 and more for spectral ones.
    refine : int
        How many times every element is divided in four; new nodes lie on the elements of the file.
    law : str
        Law of the material; one of ``law.LAWS``; ``relaxed`` wrinkles where the others carry compression.
    mass_damping : float
        Start value of the parameter: damping force per mass and velocity [1/s].
    pressure_amplitude, pressure_frequency : float
        Start values of the built-in pressure [Pa], [Hz].
    inplane_mass : float
        Factor on the inertia of the film along the surface [1], at least 1: longer steps for a stiff, thin membrane.
    expose : bool
        Whether the displacement of every node is a variable.
    directional : bool
        Whether the share of the stiffness that each zone keeps along ``direction`` of its region, and across, is an input.
    regions, zones, supports, edges, cables, beams, masses, loads, sensors, surfaces : tuple
        See there; without ``loads`` there is one follower pressure on all faces, ``pressure``.
    gas : Gas or None
        See there.
    faults : tuple of Fault
        See there.
    factors : tuple of str
        Some of ``SCALABLE``: numbers of the setup that a parameter ``<name>_factor`` of the model multiplies, in all
        regions or along all edges.
    priors : mapping of str to float
        How far numbers of the setup may be off, one standard deviation as a share [1], by the names that a calibration has;
        ``place`` of the sensors in metres.
    calibration : KnownNumbers or None
        See there; the model starts with its values.
    built : Built or None
        See there; it moves the nodes of the mesh file.

    Raises
    ------
    DescriptionError
        Values that do not go together.
    """

    regions: tuple[Region, ...]
    supports: tuple[Support, ...] = ()
    title: str = ""
    mesh: str = ""
    scale: float = 1.0
    order: int = 1
    refine: int = 0
    law: str = "st_venant_kirchhoff"
    mass_damping: float = 0.0
    pressure_amplitude: float = 0.0
    pressure_frequency: float = 7.9
    inplane_mass: float = 1.0
    expose: bool = False
    directional: bool = False
    zones: tuple[Zone, ...] = ()
    edges: tuple[Edge, ...] = ()
    cables: tuple[Cable, ...] = ()
    beams: tuple[Beam, ...] = ()
    masses: tuple[PointMass, ...] = ()
    loads: tuple[Load, ...] = (Load(name="pressure"),)
    sensors: tuple[Sensor, ...] = ()
    surfaces: tuple[Paraboloid, ...] = ()
    gas: Gas | None = None
    factors: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()
    priors: Mapping[str, float] = field(default_factory=dict, hash=False)
    calibration: KnownNumbers | None = None
    built: Built | None = None

    def __post_init__(self) -> None:
        raise_any([*self._mistakes()])

    @property
    def springs(self) -> tuple[int, ...]:
        """Supports that are springs, from 0."""
        return tuple(i for i, support in enumerate(self.supports) if support.stiffness)

    @property
    def lights(self) -> tuple[Load, ...]:
        """Loads that are light."""
        return tuple(load for load in self.loads if load.kind == "light")

    @property
    def spins(self) -> tuple[Load, ...]:
        """Loads that are centrifugal."""
        return tuple(load for load in self.loads if load.kind == "centrifugal")

    @property
    def warms(self) -> bool:
        """Whether the film expands."""
        return any(r.thermal_expansion for r in self.regions)

    @property
    def warm_lines(self) -> tuple[Line, ...]:
        """Beams and cables that expand, in the order of ``lines``."""
        return tuple(line for line in self.lines if line.thermal_expansion)

    @property
    def lines(self) -> tuple[Line, ...]:
        """Beams, then cables."""
        return (*self.beams, *self.cables)

    @property
    def scalable(self) -> tuple[str, ...]:
        """Those of ``SCALABLE`` that this setup has something of."""
        there = {"prestress": any(any(r.prestress) for r in self.regions), "tension": any(e.tension for e in self.edges)}
        there["thickness"] = not self.lines and not self.masses  # whose mass it does not change
        return tuple(name for name in SCALABLE if there.get(name, True))

    def _mistakes(self) -> Iterator[Mistake]:
        limits = {"scale": (1e-9, 1e9), "mass_damping": (0.0, 1e4), "inplane_mass": (1.0, 1e6)}
        limits |= {"pressure_amplitude": (0.0, 1e6), "pressure_frequency": (0.0, 1e4)}
        yield from outside(self, **limits)
        if not isinstance(self.order, int) or isinstance(self.order, bool) or not 1 <= self.order <= MAX_ORDER:
            text = f"'order' is {self.order!r}. Write 1 for bilinear elements, or 2 to {MAX_ORDER} for spectral ones."
            yield Mistake(("order",), text)
        if isinstance(self.refine, bool) or not 0 <= self.refine <= MOST_REFINED:
            text = f"'refine' is {self.refine!r}. Write how many times elements are divided in four, 0 to {MOST_REFINED}."
            yield Mistake(("refine",), text)
        if not self.regions:
            yield Mistake(("regions",), "there are no regions. Write [[regions]] with the material of all faces.")
        if self.directional and self.law != "st_venant_kirchhoff":
            text = f"{self.law!r} has no tear in one direction: it is that of a stress which is linear in the strain."
            yield Mistake(("directional",), f'{text} Write law = "st_venant_kirchhoff", or leave it out.')
        if self.directional and not self.zones:
            text = "shares of the stiffness are those of zones, and there are none. Write [[zones]], or leave it out."
            yield Mistake(("directional",), text)
        if self.built and any(not isinstance(place, str) for line in self.lines for place in line.path):
            text = (
                "nodes of the surface as it was built leave the places of cables and beams. Name groups of nodes in 'path'."
            )
            yield Mistake(("built",), text)
        if self.directional and any(line.zone for line in self.lines):
            yield Mistake(("directional",), "cables and beams that are zones have one direction. Leave out 'zone' or this.")
        known = tuple(line.name for line in self.lines)
        for i, sensor in enumerate(self.sensors):
            if sensor.line and sensor.line not in known:
                yield Mistake(("sensors", i, "line"), f"there is no cable or beam {sensor.line!r}.", sensor.line, known)
        rest = [i for i, r in enumerate(self.regions) if not r.group]
        if len(rest) > 1:
            yield Mistake(("regions", rest[1], "group"), "two regions have no 'group', and only one can take the rest.")
        if self.law not in LAWS:
            text = f"there is no law {self.law!r} of the membrane's material."
            yield Mistake(("law",), text, self.law, tuple(LAWS))
        elif not LAWS[self.law].linear:
            for i, r in enumerate(self.regions):
                if r.prestrain > HOOKEAN:
                    text = (
                        f"a prestress of {r.prestrain:.2g} of Young's modulus is beyond the range in which {self.law!r} is "
                        f"Hooke's, {HOOKEAN:g}. Stretch the membrane by its supports instead, or take another law."
                    )
                    yield Mistake(("regions", i, "prestress"), text)
        for k, name in enumerate(self.factors):
            if name not in self.scalable or name in self.factors[:k]:
                text = f"the setup has no {name!r} that a factor could multiply, or it stands twice."
                yield Mistake(("factors",), text, name, self.scalable)
        for name, count in Counter(fault.name for fault in self.faults).items():
            if count > 1:
                yield Mistake(("faults",), f"{count} faults have the name {name!r}. Give each its own.")
        names = [load.name for load in self.loads] + [support.motion for support in self.supports if support.motion]
        names += [output for surface in self.surfaces for output in surface.outputs]
        names += [f"{load.name}_{what}" for load in self.lights for what in ("direction", "eclipse")]
        for name in RESERVED & set(names):
            text = f"a load, motion or surface has the name {name!r}, which is that of another variable. Choose another."
            yield Mistake(("loads",), text)
        for name, count in Counter(names).items():
            if count > 1:
                text = f"{count} loads, motions or results of surfaces have the name {name!r}. Give each its own."
                yield Mistake(("loads",), text)
