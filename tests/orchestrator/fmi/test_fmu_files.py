"""FMU files that are none, that are dangerous, or that do not run here are refused."""

from __future__ import annotations

import stat
import struct
import zipfile

import pytest
from gossamer_orchestrator import FmuError, FmuFile, ScenarioError, load_scenario, run_scenario
from gossamer_orchestrator.fmi import archive


def make_archive(path, name="modelDescription.xml", content="<fmiModelDescription/>", mode=0o644):
    with zipfile.ZipFile(path, "w") as file:
        member = zipfile.ZipInfo(name)
        member.external_attr = mode << 16
        file.writestr(member, content, zipfile.ZIP_DEFLATED)
    return path


def test_a_file_that_is_no_archive_is_refused(tmp_path):
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(FmuError, match=r"text.fmu is not an FMU. It is text."):
        FmuFile(tmp_path / "text.fmu")


def test_what_a_file_is_instead_of_an_fmu_is_said(fmus, tmp_path):
    half = (fmus / "gain.fmu").read_bytes()[:3000]
    contents = {"half": half, "picture": b"\x89PNG\r", "nothing": b"", "data": b"\0\1"}
    for name, content in contents.items():
        (tmp_path / f"{name}.fmu").write_bytes(content)
    make_archive(tmp_path / "structure.fmu", "SystemStructure.ssd")
    for name, what in {
        "half": "It is an incomplete ZIP archive. Build or copy it again.",
        "picture": "It is a picture",
        "nothing": "It is empty.",
        "data": "It is some other data.",
        "structure": "It is an SSP: run it with 'gossamer run'.",
        "halv": "there is no file .*halv.fmu. Did you mean 'half.fmu'?",
        "": "is not an FMU. It is a folder.",
    }.items():
        with pytest.raises(FmuError, match=what):
            FmuFile(tmp_path / f"{name}.fmu" if name else tmp_path)
    with pytest.raises(
        ScenarioError, match=r"gain.fmu is not a scenario .* It is an FMU: look at it with 'gossamer info' or"
    ):
        load_scenario(fmus / "gain.fmu")


def test_an_fmu_is_checked_again_when_it_is_unpacked(fmus, monkeypatch):
    file = FmuFile(fmus / "gain.fmu")
    monkeypatch.setattr(archive, "MAX_BYTES", 10)
    with pytest.raises(FmuError, match="It is not unpacked"):
        file.folder()
    file.close()


def test_no_more_is_unpacked_than_was_declared(tmp_path):
    make_archive(tmp_path / "bomb.fmu", content="0" * 1_000_000)
    lie = (tmp_path / "bomb.fmu").read_bytes().replace(struct.pack("<L", 1_000_000), struct.pack("<L", 10))
    (tmp_path / "bomb.fmu").write_bytes(lie)
    with pytest.raises(FmuError, match=r"cannot be unpacked: .*CRC"):
        archive.unpack(tmp_path / "bomb.fmu", tmp_path / "x")
    assert sum(path.stat().st_size for path in (tmp_path / "x").rglob("*")) <= 10


@pytest.mark.parametrize("name", ["../../evil.so", "/etc/evil", "..\\evil.so", "C:evil"])
def test_an_archive_that_leaves_its_folder_is_refused(tmp_path, name):
    with pytest.raises(FmuError, match="would be written outside its folder"):
        FmuFile(make_archive(tmp_path / "evil.fmu", name))


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("separator", ["/", "\\"])
def test_an_archive_of_a_careless_tool_is_unpacked(tmp_path, separator, times):
    """Backslashes between folders, and the same file twice."""
    with zipfile.ZipFile(tmp_path / "it.fmu", "w") as file:
        for name in ["modelDescription.xml", f"resources{separator}inner{separator}y.txt"] * times:
            file.writestr(name, "a")
    archive.unpack(tmp_path / "it.fmu", tmp_path / "it")
    assert (tmp_path / "it/resources/inner/y.txt").read_text() == "a"


def test_a_link_in_an_archive_is_refused(tmp_path):
    with pytest.raises(FmuError, match="'lib' is a link"):
        FmuFile(make_archive(tmp_path / "link.fmu", "lib", "/etc/passwd", stat.S_IFLNK | 0o777))


def test_an_absurdly_large_archive_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "MAX_BYTES", 10)
    with pytest.raises(FmuError, match="It is not unpacked"):
        FmuFile(make_archive(tmp_path / "bomb.fmu"))


def test_an_archive_without_or_with_a_broken_model_description_is_refused(tmp_path):
    with pytest.raises(FmuError, match=r"holds no modelDescription.xml"):
        FmuFile(make_archive(tmp_path / "empty.fmu", "readme.txt"))
    with pytest.raises(FmuError, match=r"its modelDescription.xml is not valid"):
        FmuFile(make_archive(tmp_path / "broken.fmu"))


def test_an_fmu_without_a_binary_for_this_machine_is_refused_when_it_is_started(fmus, tmp_path, chain):
    with zipfile.ZipFile(fmus / "gain.fmu") as old, zipfile.ZipFile(tmp_path / "gain.fmu", "w") as new:
        for member in old.infolist():
            if not member.filename.endswith(".so"):
                new.writestr(member, old.read(member))
    (tmp_path / "integrator.fmu").write_bytes((fmus / "integrator.fmu").read_bytes())
    message = r"cannot be started: It has no binaries/\w+/ToyGain.\w+, which this machine needs; it has binaries for win64.$"
    with pytest.raises(FmuError, match=message):
        run_scenario(chain(), tmp_path)


def test_the_elements_of_an_array_go_by_their_indices_in_whatever_order_they_are_declared(edited, tmp_path):
    """An FMU of FMI 2.0 may list a matrix by columns; connected to one by rows it must not be transposed."""

    def swap(xml):
        for old, new in (("offset[1]", "offset[x]"), ("offset[2]", "offset[1]"), ("offset[x]", "offset[2]")):
            xml = xml.replace(old, new)
        return xml

    edited("gain", "swapped", swap)
    fmu = FmuFile(tmp_path / "swapped.fmu")
    assert [v for v in fmu.variables if v.startswith("offset")][:2] == ["offset[2]", "offset[1]"]
    assert fmu.elements("offset")[:2] == ["offset[1]", "offset[2]"]
