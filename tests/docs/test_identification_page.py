"""The page of results: its links, and its generator on a few quick fits."""

import re
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from gossamer_models.fractional import FractionalSettings
from gossamer_models.sensor.fit import PreisachSettings, fit_preisach
from studies import chapter_measured, literature, misses, noise, preisach_plane
from studies.automatic import DefaultRow
from studies.compute import Results
from studies.fractional import fit_row, limits, repeat_on_dataset_3
from studies.measured import MeasuredFit
from studies.metrics import Metric
from studies.page import write
from studies.preisach import SpecimenFit
from studies.recovery import Recovery
from studies.specimen import specimen_record

DOCS = Path(__file__).parents[2] / "docs"
LINK = re.compile(r"!\[[^]]*\]\(([^)]+)\)")
THESIS_FIGURES = [f"{c}.{k}" for c, last in ((3, 5), (4, 10)) for k in range(1, last + 1)] + ["5.3", "5.5"]


@pytest.fixture(scope="module")
def results():
    """One row of each table, from quick fits; one of them stands in for all Preisach fits."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise, "SAMPLES", 1500)
        ways = noise.run_ways(0.001, (0,))
    estimator = ways[-1]
    wrong = [replace(estimator, how="estimator, strain known 0 times", eta_error=error) for error in (-0.02, 0.02)]
    record = specimen_record(3)
    settings = PreisachSettings(modes=1, relaxations=1, n_lines=8, starts=1)
    fit = fit_preisach((record,), (record.time < 200.0,), settings, rest_resistance=0.0)
    both = (specimen_record(1), specimen_record(2))
    models = ("model-1", "sub-model-1", "sub-model-2")
    rows = [fit_row(FractionalSettings(model=model, terms=3, starts=1)) for model in models]
    row = SpecimenFit(modes=3, fit=fit, seconds=1.0, records=both, predicted=tuple(0.9 * each.resistance for each in both))
    return Results(
        specimen=[row],
        chosen=[row],
        speed=[Metric(what="fit", unit="s", value=1.0, target=10.0)],
        recovery=Recovery(
            record=record,
            fit=fit,
            time=record.time,
            strain=record.strain,
            predicted=record.time >= 200.0,
            estimates={"exact inverse": 0.98 * record.strain, "estimator": record.strain[:-24]},
            deviation=np.full(record.time.size - 24, 1e-3),
        ),
        rows=rows,
        limits=limits(),
        repeated=repeat_on_dataset_3(rows),
        noise=[*ways, *(replace(case, noise=0.005) for case in ways)],
        more_noise=[],
        wrong_eta=wrong,
        measured=[
            MeasuredFit(
                name=name,
                model="extension",
                record=record,
                fit=fit,
                recovered={"direct inverse": record.strain},
                targets=(0.0, None),
                strain_targets=(1.0, 1.0),
            )
            for name in ("strain_triangular", "velocity_profile_10wt")
        ],
        automatic=[
            DefaultRow(
                name="strain_sin_20",
                chosen="filter",
                forward={"defaults": 1.0, "cubic": 5.0},
                strain={"defaults": 2.0, "cubic": 1.5},
                ratio=1.1,
                seconds=1.0,
                forward_target=1.5,
                strain_target=1.2,
            )
        ],
    )


@pytest.fixture(scope="module")
def written(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("docs")
    with mpl.rc_context():
        write(results, folder)
    return folder


def test_every_picture_of_the_page_exists_and_none_is_left_over():
    text = (DOCS / "identification.md").read_text(encoding="utf-8")
    links = LINK.findall(text)
    assert links
    assert {DOCS / link for link in links} == set((DOCS / "identification").glob("*"))


def test_the_pictures_of_the_page_are_small():
    assert sum(path.stat().st_size for path in (DOCS / "identification").glob("*.png")) < 1.5e6


def test_the_page_names_every_table_and_missing_figure_of_the_thesis():
    text = (DOCS / "identification.md").read_text(encoding="utf-8")
    assert all(f"Table {number}" in text for number in ("3.1", "3.2", "4.1"))
    named = set(re.findall(r"\d\.\d+", " ".join(re.findall(r"In place of Figures? ([^:]*):", text))))
    # ranges are written out, so every figure is found by its number
    assert set(THESIS_FIGURES) <= named


def test_the_generator_writes_the_page_and_its_pictures(written):
    text = (written / "identification.md").read_text(encoding="utf-8")
    links = LINK.findall(text)
    assert {written / link for link in links} == set((written / "identification").glob("*.png"))
    assert "nan" not in text
    assert all(f"| {work} |" in text for work, _, _ in literature.WORKS)
    assert "strain_triangular, forward, train" in text.split("## Missed targets")[1]


def test_pictures_have_the_same_bytes_every_time(written, tmp_path):
    preisach_plane.relays(tmp_path)
    assert (tmp_path / "relays.png").read_bytes() == (written / "identification" / "relays.png").read_bytes()


def test_a_page_without_measured_records_says_so(results, tmp_path):
    lines = chapter_measured.section(replace(results, measured=(), transfers=()), tmp_path)
    assert "records were missing when this page was made" in "\n".join(lines)


def test_a_miss_without_a_written_limit_is_not_explained_away():
    metric = Metric(what="something new", unit="%", value=2.0, target=1.0)
    assert misses.limit_of(metric) == misses.UNKNOWN
    assert "something new" in "\n".join(misses.section([metric]))


def test_the_drawn_relays_close_without_partial_switching_and_climb_with_it():
    cycle = np.concatenate([preisach_plane.path(2), preisach_plane.path(2)[::-1]])
    assert preisach_plane.output(cycle, 1.0)[-1] == pytest.approx(0.0, abs=1e-12)
    assert preisach_plane.output(cycle, 0.7)[-1] == pytest.approx(0.3, abs=1e-12)
    # uniform density: u**2 on the way up
    assert preisach_plane.output(preisach_plane.path(1), 1.0)[-1] == pytest.approx(0.36, abs=0.005)
