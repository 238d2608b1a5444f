"""Solve a membrane with Kratos: ``python membrane.py problem.npz answer.npz``, with a Python that has Kratos.

The problem: ``nodes`` (N, 3) [m]; ``cells`` (n, 3 or 4) counter-clockwise about the normal that pressure acts along;
``modulus`` (n,) [Pa]; ``nu``, ``density`` [kg/m3], ``thickness`` [m]; ``held`` (N, 3); ``pressure`` (k,) [Pa] in k states or
at the end of k steps; ``displaced`` (k, N, 3) [m] of what is held; ``step`` [s], 0 for states; ``damping`` [1/s];
``wrinkles``; ``guess`` (k or 1, N, 3), where Newton's method begins. The answer: ``displacement`` (k, N, 3) [m] and
``converged`` (k,).
"""

import sys
from typing import Any

import KratosMultiphysics as Kratos
import KratosMultiphysics.ConstitutiveLawsApplication  # registers the law that wrinkles
import KratosMultiphysics.LinearSolversApplication  # registers the solver
import KratosMultiphysics.StructuralMechanicsApplication as Structural
import numpy as np

AXES = (Kratos.DISPLACEMENT_X, Kratos.DISPLACEMENT_Y, Kratos.DISPLACEMENT_Z)
REACTIONS = (Kratos.REACTION_X, Kratos.REACTION_Y, Kratos.REACTION_Z)
NODAL = (
    Kratos.DISPLACEMENT,
    Kratos.REACTION,
    Kratos.VELOCITY,
    Kratos.ACCELERATION,
    Kratos.VOLUME_ACCELERATION,
    Kratos.POSITIVE_FACE_PRESSURE,
    Kratos.NEGATIVE_FACE_PRESSURE,
    Structural.POINT_LOAD,
)


def material(part: Any, number: int, modulus: float, problem: Any) -> Any:  # noqa: ANN401
    """Add the properties of elements with one modulus."""
    found = part.CreateNewProperties(number)
    found.SetValue(Kratos.YOUNG_MODULUS, modulus)
    found.SetValue(Kratos.POISSON_RATIO, float(problem["nu"]))
    found.SetValue(Kratos.DENSITY, float(problem["density"]))
    found.SetValue(Kratos.THICKNESS, float(problem["thickness"]))
    found.SetValue(Kratos.COMPUTE_LUMPED_MASS_MATRIX, True)
    found.SetValue(Structural.PRESTRESS_VECTOR, Kratos.Vector([0.0, 0.0, 0.0]))
    found.SetValue(Structural.RAYLEIGH_ALPHA, float(problem["damping"]))
    found.SetValue(Structural.RAYLEIGH_BETA, 0.0)
    found.SetValue(Kratos.CONSTITUTIVE_LAW, Structural.LinearElasticPlaneStress2DLaw())
    return found


def model_part(model: Any, problem: Any) -> Any:  # noqa: ANN401
    """Make nodes, elements, pressed faces and supports."""
    part = model.CreateModelPart("membrane")
    part.ProcessInfo[Kratos.DOMAIN_SIZE] = 3
    for variable in NODAL:
        part.AddNodalSolutionStepVariable(variable)
    part.SetBufferSize(2)
    for i, (x, y, z) in enumerate(problem["nodes"].tolist()):
        part.CreateNewNode(i + 1, x, y, z)
    properties = {}
    for k, modulus in enumerate(np.unique(problem["modulus"]).tolist()):
        taut = material(part, 2 * k + 1, modulus, problem)
        properties[modulus] = taut
        if problem["wrinkles"]:
            properties[modulus] = material(part, 2 * k + 2, modulus, problem)
            properties[modulus].AddSubProperties(taut)
            law = Kratos.KratosGlobals.GetConstitutiveLaw("WrinklingLinear2DLaw").Clone()
            properties[modulus].SetValue(Kratos.CONSTITUTIVE_LAW, law)
    corners = problem["cells"].shape[1]
    pressed = part.CreateNewProperties(0)
    for i, (cell, modulus) in enumerate(zip(problem["cells"].tolist(), problem["modulus"].tolist(), strict=True)):
        ids = [c + 1 for c in cell]
        part.CreateNewElement(f"MembraneElement3D{corners}N", i + 1, ids, properties[modulus])
        part.CreateNewCondition(f"SurfaceLoadCondition3D{corners}N", i + 1, ids, pressed)
    for axis, reaction in zip(AXES, REACTIONS, strict=True):
        Kratos.VariableUtils().AddDof(axis, reaction, part)
    for i, a in zip(*np.nonzero(problem["held"]), strict=True):
        part.GetNode(int(i) + 1).Fix(AXES[a])
    return part


def main() -> None:
    """Solve the states or steps one after the other."""
    problem = np.load(sys.argv[1])
    step, states = float(problem["step"]), len(problem["pressure"])
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    model = Kratos.Model()
    part = model_part(model, problem)
    moving = Kratos.ResidualBasedBossakDisplacementScheme(0.0)  # Newmark's, of the average acceleration
    scheme = moving if step else Kratos.ResidualBasedIncrementalUpdateStaticScheme()
    solver = Kratos.LinearSolverFactory().Create(Kratos.Parameters('{"solver_type": "LinearSolversApplication.sparse_lu"}'))
    strategy = Kratos.ResidualBasedNewtonRaphsonStrategy(
        part,
        scheme,
        Kratos.ResidualCriteria(1e-7, 1e-9),
        Kratos.ResidualBasedBlockBuilderAndSolver(solver),
        30,
        False,
        False,
        True,
    )
    strategy.SetEchoLevel(0)
    strategy.Initialize()
    part.ProcessInfo[Kratos.DELTA_TIME] = step or 1.0
    displacement, converged = np.empty((states, len(problem["nodes"]), 3)), list[bool]()
    for k in range(states):
        part.CloneTimeStep((k + 1) * (step or 1.0))
        part.ProcessInfo[Kratos.STEP] = k + 1
        if k < len(problem["guess"]):
            for node, at in zip(part.Nodes, problem["guess"][k].tolist(), strict=True):
                for buffer in (0, 1):
                    node.SetSolutionStepValue(Kratos.DISPLACEMENT, buffer, at)
                node.X, node.Y, node.Z = node.X0 + at[0], node.Y0 + at[1], node.Z0 + at[2]
        for condition in part.Conditions:
            condition.SetValue(Kratos.POSITIVE_FACE_PRESSURE, -float(problem["pressure"][k]))
        for i, a in zip(*np.nonzero(problem["held"]), strict=True):
            part.GetNode(int(i) + 1).SetSolutionStepValue(AXES[a], float(problem["displaced"][k, i, a]))
        strategy.InitializeSolutionStep()
        strategy.Predict()
        converged.append(strategy.SolveSolutionStep())
        strategy.FinalizeSolutionStep()
        displacement[k] = [[node.X - node.X0, node.Y - node.Y0, node.Z - node.Z0] for node in part.Nodes]
    np.savez(sys.argv[2], displacement=displacement, converged=np.array(converged))


if __name__ == "__main__":
    main()
