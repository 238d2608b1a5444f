"""The nomenclature names what exists, lists every equation that the models cite, and they cite what it says."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "models" / "gossamer_models"
PAGE = (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8")
PLACE = re.compile(r"`([\w/]+\.py)(?:: ([\w.]+(?:, [\w.]+)*))?`")
NUMBER = r"\((\d)\.(\d+)\)"
CITED = re.compile(rf"Eqs?\.\s+{NUMBER}(?:(?:,\s(?:and\s|or\s)?|\s(?:and|or|to)\s){NUMBER})*")
THESIS = (
    "M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite "
    "Sensors, dissertation, Virginia Tech, 2010"
)


def resolved(path):
    return (ROOT if path.startswith(("docs/", "tests/")) else MODELS) / path


def names_in(file):
    """Functions, classes, their methods and the constants of a file."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    names = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{each.name}" for each in node.body if isinstance(each, ast.FunctionDef)}
        if isinstance(node, ast.Assign):
            names |= {each.id for each in node.targets if isinstance(each, ast.Name)}
    return names


def equations(text):
    """Numbers of all equations that a text cites, those between the ends of a range included."""
    found = set()
    for match in CITED.finditer(" ".join(text.split())):
        words = re.split(NUMBER, match.group())
        numbers = [(int(a), int(b)) for a, b in zip(words[1::3], words[2::3], strict=True)]
        for between, (chapter, first), (_, last) in zip(words[3::3], numbers, numbers[1:], strict=False):
            if between.strip() == "to":
                found |= {(chapter, each) for each in range(first, last)}
        found |= set(numbers)
    return found


def rows():
    """Equations or section, and places, of every row of the table of equations."""
    table = PAGE.partition("## Equations of the thesis")[2]
    for line in table.splitlines():
        if line.startswith(("| (", "| Section")):
            first, _, where = (cell.strip() for cell in line.strip("|").split(" | "))
            yield first, PLACE.findall(where)


def test_a_range_of_equations_holds_those_in_between():
    assert equations("see Eqs. (4.14) to (4.17) and Eq. (3.1), Eqs. (5.3),\n  (5.4) or (5.7)") == {
        (3, 1),
        *((4, n) for n in (14, 15, 16, 17)),
        (5, 3),
        (5, 4),
        (5, 7),
    }


def test_every_file_function_and_class_exists():
    places = PLACE.findall(PAGE)
    assert len(places) > 100
    for path, names in places:
        assert resolved(path).is_file(), path
        missing = set(filter(None, names.split(", "))) - names_in(resolved(path))
        assert not missing, f"{path}: {missing}"


def test_no_path_is_written_in_another_way():
    assert len(re.findall(r"\w\.py\b", PAGE)) == len(PLACE.findall(PAGE))


def test_every_row_has_as_many_cells_as_its_head():
    for line in PAGE.splitlines():
        if line.startswith("|"):
            cells = re.split(r"(?<!\\)\|", line)
            assert len(cells) in (5, 6), line


def test_every_equation_that_models_cite_is_listed():
    listed = {(int(a), int(b)) for first, _ in rows() for a, b in re.findall(NUMBER, first)}
    for file in sorted(MODELS.rglob("*.py")):
        missing = equations(file.read_text(encoding="utf-8")) - listed
        assert not missing, f"{file.relative_to(ROOT)}: {missing}"


def test_every_file_that_implements_an_equation_cites_it():
    for first, places in rows():
        assert places, first
        for path, _ in places:
            text = resolved(path).read_text(encoding="utf-8")
            wanted = {(int(a), int(b)) for a, b in re.findall(NUMBER, first)}
            if path.startswith(("docs/", "tests/")):
                continue
            assert wanted <= equations(text), f"{path} does not cite {first}"
            if first.startswith("Section"):
                assert first in " ".join(text.split()), f"{path} does not cite {first}"


@pytest.mark.parametrize("folder", ["models", "fmus", "orchestrator", "docs"])
def test_the_thesis_is_cited_one_way(folder):
    """Without quotation marks in docstrings and with them on pages."""
    files = [file for suffix in ("py", "md") for file in (ROOT / folder).rglob(f"*.{suffix}")]
    for file in [*files, ROOT / "README.md"]:
        text = " ".join(file.read_text(encoding="utf-8").split())
        if file.suffix == ".md" or folder == "docs":
            text = text.replace('"', "")
        assert text.count("Sunny") == text.count(THESIS), file


def test_the_models_point_to_the_page():
    assert "docs/nomenclature.md" in (MODELS / "__init__.py").read_text(encoding="utf-8")
