"""A detector of any structure: a dish of five zones and five sensors, from its setup to a network that names its zones."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gossamer.plans import judged_on
from gossamer_fmus.catalogue import make_model
from gossamer_models import ArtifactError, ParameterError, Stepper, simulate
from gossamer_models.assessment import PosteriorJudge, conditions, plan_of_square, read_judge
from gossamer_models.assessment.conditions import detections, finer
from gossamer_models.assessment.figures import errors, held_out_verdicts
from gossamer_models.campaign import Mesh, Vary, campaign_of_setup, read_campaign, run_campaign
from gossamer_models.campaign.symmetry import Symmetry, mirrors
from gossamer_models.detector import PosteriorArtifact, judge_records, posterior_model
from gossamer_models.detector.posterior_records import Training
from gossamer_models.detector.posterior_training import train_posterior
from gossamer_models.membrane import Load, first_period, membrane_model, square_structure
from gossamer_models.mistakes import DescriptionError
from gossamer_models.twin import LoadTable, MembraneForward
from gossamer_orchestrator.errors import OrchestratorError
from oracles.dish import dish_file, dish_setup

meshio = pytest.importorskip("meshio")
pytest.importorskip("ziglang", reason="a campaign needs the compiler for its speed")


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    """The dish, which 200 Pa at 12 Hz shake."""
    file = dish_file()
    path = tmp_path_factory.mktemp("dish") / "dish.inp"
    sets = {"rim": file.points["rim"]}
    meshio.write(path, meshio.Mesh(file.nodes, [("quad", file.quadrilaterals)], point_sets=sets))
    return dish_setup(file, mesh=str(path), pressure_amplitude=200.0, pressure_frequency=12.0)


@pytest.fixture(scope="module")
def trained(setup, tmp_path_factory):
    """A network of the first window alone, and the campaign."""
    plan = campaign_of_setup(Mesh(setup=setup), cases=700)
    plan = replace(plan, stop=plan.window, damage=replace(plan.damage, onset=(0.0, 0.0)))
    folder = tmp_path_factory.mktemp("campaign") / "dish.zarr"
    run_campaign(plan, folder, workers=2)
    data = read_campaign(folder)
    training = replace(Training.of(data), steps=600, components=48, width=128, batch=256)
    return train_posterior(data, training), data, training


def test_windows_and_steps_are_those_of_the_structure(setup):
    """Three periods of the load, which hold two of the first mode; the run lasts until 2 % of the start are left."""
    plan = campaign_of_setup(Mesh(setup=setup), cases=10, noise=2e-4)
    assert first_period(plan.membrane.structure) < 3.0 / 12.0 / 2.0
    assert plan.window == pytest.approx(3.0 / 12.0)
    assert plan.step == pytest.approx(plan.window / 600)
    assert plan.stop == pytest.approx(3 * plan.window)
    assert plan.noise.strain.normal == 2e-4
    quick = Mesh(setup=setup, parameters={"pressure_frequency": 100.0})
    assert campaign_of_setup(quick, cases=10).window >= 2.0 * first_period(plan.membrane.structure)


def shaken(setup, **change):
    """The dish without a pressure, whose base is shaken along its axis for three periods of 12 Hz, as a table says."""
    time = np.linspace(0.0, 0.25, 301)
    values = {"base_acceleration[3]": tuple(30.0 * np.sin(2.0 * np.pi * 12.0 * time))}
    return Mesh(setup=setup, load=LoadTable(values=values, time=tuple(time)), **change)


QUIET = {"pressure_amplitude": 0.0}


def test_a_table_of_loads_is_a_window_and_repeated(setup):
    plan = campaign_of_setup(shaken(setup, parameters=QUIET), cases=10)
    assert plan.window == pytest.approx(0.25)
    assert plan.stop == pytest.approx(3 * 0.25)
    assert campaign_of_setup(shaken(setup), cases=10).window == pytest.approx(0.25)  # three periods of the pressure, too
    with pytest.raises(ParameterError, match=r"the built-in pressure of 13 Hz acts, too, .* holds 3.25 of its periods"):
        campaign_of_setup(shaken(setup, parameters={"pressure_frequency": 13.0}), cases=10)
    with pytest.raises(DescriptionError, match="states of rest, and a case is a history"):
        Mesh(setup=setup, load=LoadTable(values={"pressure": (0.0, 1.0)}))
    with pytest.raises(DescriptionError, match="stands in the table of loads and is a constant, too"):
        shaken(setup, parameters={"base_acceleration[3]": 1.0})
    with pytest.raises(DescriptionError, match="Vary 'load', a factor on all of them"):
        replace(plan, vary={"base_acceleration[3]": Vary(range=(0.0, 1.0))})


def test_cases_under_a_table_of_loads_are_those_of_the_twin(setup, tmp_path):
    """Damage that is there or begins, a load as large as drawn; and the detector carries its load to be judged under it."""
    mesh = shaken(setup, parameters=QUIET)
    plan = replace(campaign_of_setup(mesh, cases=8, seed=3), stop=0.05, window=None, vary={"load": Vary(factor=(0.5, 2.0))})
    plan = replace(plan, damage=replace(plan.damage, onset=(-0.1, 0.04)))
    run_campaign(plan, tmp_path / "shaken.zarr", workers=1)
    data = read_campaign(tmp_path / "shaken.zarr")
    assert data["load"].attrs["long_name"] == "Factor on the loads"
    there = np.flatnonzero(data["onset"].to_numpy() == 0.0)
    forward = MembraneForward(mesh.structure, QUIET)
    acting = mesh.load.loads(plan.steps, plan.step).histories["base_acceleration[3]"]
    scaled = {"base_acceleration[3]": data["load"].to_numpy()[there, None] * acting}
    strain = forward.strain(data["damage"].to_numpy()[there], {}, scaled, plan.steps, plan.step)
    np.testing.assert_allclose(data["strain"].to_numpy()[there], strain, rtol=1e-4, atol=1e-7 * np.ptp(strain))
    names = [condition.name for condition in conditions(plan, None, 4)]
    assert "load x 0.9" in names


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"zones": ()}, "the setup has no zones, so there is no damage to find"),
        ({"sensors": ()}, "the setup has no sensors, so nothing is measured"),
        ({"pressure_amplitude": 0.0}, "nothing moves this structure.* its first frequency is"),
        ({"loads": (Load(name="sun", kind="light"),)}, "no load of the kind pressure"),
    ],
)
def test_a_setup_without_what_a_detector_needs_is_refused(setup, change, message):
    with pytest.raises(ParameterError, match=message):
        campaign_of_setup(Mesh(setup=replace(setup, **change)), cases=10)


def test_the_detector_finds_damage_by_name(trained, capsys):
    artifact, data, training = trained
    assert (artifact.zones, artifact.sensors) == (5, 5)
    model = posterior_model(artifact)
    texts = {v.name: v.description for v in model.variables}
    assert texts["damage[5]"] == f"Estimated loss of stiffness in {artifact.zone_names[4]}"
    assert artifact.noise == pytest.approx(1e-4)
    found = {kind: errors(*pair) for kind, pair in held_out_verdicts(artifact, data, training).items()}
    with capsys.disabled():
        print(f"\n{found}")
    zero, noisy = found["always 0"], found["window 1, damaged, noise"]
    assert noisy["all zones"] < 0.25 * zero["all zones"]


def test_the_fmu_judges_as_the_training_does(trained):
    artifact, data, training = trained
    record = data["strain"][:1].to_numpy().astype(float)
    record += np.random.default_rng(1).normal(0.0, artifact.noise, record.shape)
    expected = judge_records(artifact, 0, record)
    stepper = Stepper(posterior_model(artifact))
    stepper.initialize()
    inputs = {f"strain[{k + 1}]": row for k, row in enumerate(record[0])}
    simulate(stepper, np.full(training.samples, artifact.sampling_step), inputs, ())
    found = [stepper.get(f"damage[{zone}]") for zone in range(1, 6)]
    assert found == pytest.approx(expected["damage"][0], abs=1e-9)
    assert stepper.get("misfit") == pytest.approx(expected["misfit"][0], rel=1e-6)


def test_a_detector_of_another_structure_is_refused(trained, setup, tmp_path):
    artifact, *_ = trained
    artifact = replace(artifact, load=shaken(setup).load, parameters=QUIET)
    artifact.write(tmp_path / "dish.json")
    assert PosteriorArtifact.read(tmp_path / "dish.json").load == artifact.load
    assert judged_on([tmp_path / "dish.json"], None, None, None).membrane.load == artifact.load
    structure = Mesh(setup=setup).structure
    assert isinstance(read_judge(tmp_path / "dish.json", structure), PosteriorJudge)
    with pytest.raises(ArtifactError, match="trained for 5 zones and 5 sensors, and this structure has 16 and 4"):
        read_judge(tmp_path / "dish.json", square_structure())
    other = Mesh(setup=replace(setup, zones=(replace(setup.zones[0], name="{sector} of {ring}"),))).structure
    with pytest.raises(ArtifactError, match="whose zone 1 is 'ring 1 sector 1', and here it is '1 of 1'"):
        read_judge(tmp_path / "dish.json", other)
    thicker = replace(setup, title="Another dish", regions=(replace(setup.regions[0], thickness=1e-4),))
    with pytest.raises(ArtifactError, match=r"trained for 'dish.inp', and this structure, 'Another dish', has other reg"):
        read_judge(tmp_path / "dish.json", Mesh(setup=thicker).structure)


def test_a_detector_carries_the_structure_that_it_is_trained_for(trained, setup, tmp_path):
    """Mesh and all: what it is judged on needs no file, has the same model, and can be made finer."""
    artifact, *_ = trained
    artifact.write(tmp_path / "dish.json")
    again = PosteriorArtifact.read(tmp_path / "dish.json")
    assert setup.mesh not in (tmp_path / "dish.json").read_text()
    plan = judged_on([tmp_path / "dish.json"], None, None, None)
    assert (plan.step, plan.noise.strain.normal) == (artifact.sampling_step, pytest.approx(artifact.noise))
    own, there = Mesh(setup=setup).structure, plan.membrane.structure
    assert membrane_model(there).digest == membrane_model(replace(own, setup=there.setup)).digest
    assert again.parameters == {}
    finest, known = finer(plan.membrane).structure, finer(Mesh(setup=setup)).structure
    assert sorted(map(tuple, finest.mesh.nodes.round(9))) == sorted(map(tuple, known.mesh.nodes.round(9)))
    with pytest.raises(OrchestratorError, match="needs a setup"):
        judged_on([], None, None, ["pressure_amplitude=3"])
    with pytest.raises(ArtifactError, match="trained for 5 zones and 5 sensors"):
        make_model("detector", artifact=tmp_path / "dish.json", structure=square_structure())
    assert make_model("detector", artifact=tmp_path / "dish.json", structure=own).name == "detector"


def test_conditions_of_a_setup_vary_what_it_has(setup):
    """No sensor is known of it, so there is no chain; its region has a modulus by number."""
    plan = replace(campaign_of_setup(Mesh(setup=setup), cases=1), stop=0.25)
    put = {condition.name: condition for condition in conditions(plan, finer(plan.membrane), 8)}
    square = {condition.name for condition in conditions(plan_of_square(), finer(Mesh()), 8)}
    of_square = {"whole chain", "healthy, whole chain", "other sensors", "less sensitive sensors"}
    assert square - set(put) == {*of_square, "prestrain x 0.9", "prestrain x 1.05"}  # it is not prestressed
    assert set(put["modulus x 0.98"].campaign.vary) == {"youngs_modulus[1]"}
    assert put["another mesh"].campaign.membrane.setup.order == 2
    (pair,) = detections(plan, 10)
    assert pair.damaged.campaign.count == 2 * 5


def test_images_are_found_or_none(setup, trained):
    """The square is symmetric about both middle lines; five sensors of a dish that stand anywhere are not."""
    assert len(next(mirrors(square_structure())).zones) == 4
    found = [*mirrors(Mesh(setup=setup).structure)]
    assert [len(each.zones) for each in found] == [1]
    stored = Symmetry.stored(json.loads(trained[1].attrs["symmetry"]))
    assert stored.zones.tolist() == [[0, 1, 2, 3, 4]]
