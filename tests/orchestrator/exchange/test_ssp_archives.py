"""SSP archives that are dangerous, damaged or none are refused."""

from __future__ import annotations

import stat
import zipfile
from pathlib import Path

import pytest
from gossamer_files import write_archive
from gossamer_orchestrator import OrchestratorError, ScenarioError, open_ssp
from gossamer_orchestrator.errors import writing
from gossamer_orchestrator.exchange.ssp_files import SSP
from gossamer_orchestrator.fmi import archive
from gossamer_orchestrator.scenario.source import find_scenario


def raw(path: Path, *names: str, mode: int = 0o644) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        for number, name in enumerate(names):
            member = zipfile.ZipInfo(name)
            member.external_attr = mode << 16
            file.writestr(member, str(number) * 100)
    return path


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "..\\evil", "C:evil"])
def test_an_archive_that_leaves_its_folder_is_refused(tmp_path, name):
    with pytest.raises(ScenarioError, match="would be written outside its folder"), open_ssp(raw(tmp_path / "a.ssp", name)):
        pass


def test_a_link_is_refused(tmp_path):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd", mode=stat.S_IFLNK | 0o777)
    with pytest.raises(ScenarioError, match=r"'SystemStructure.ssd' is a link"), open_ssp(path):
        pass


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("second", ["a/b", "a//b", "./a/b"])
def test_a_member_that_is_there_twice_is_refused(tmp_path, second):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd", "a/b", second)
    with pytest.raises(ScenarioError, match=f"{second!r} is in it twice"), open_ssp(path):
        pass


def test_an_encrypted_member_is_refused(tmp_path):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd")
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    with pytest.raises(ScenarioError, match=r"'SystemStructure.ssd' is encrypted"), open_ssp(path):
        pass


def test_a_member_larger_than_it_says_is_refused(tmp_path):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd")
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\x01\x02") + 24
    data[at : at + 4] = (10).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(ScenarioError, match=r"a.ssp cannot be unpacked: Bad CRC-32"), open_ssp(path):
        pass


def test_a_bomb_is_refused_by_what_it_says_and_nothing_comes_out(tmp_path, monkeypatch):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd", "b")
    monkeypatch.setattr(archive, "MAX_BYTES", 150)
    with pytest.raises(ScenarioError, match="It is not unpacked"), open_ssp(path):
        pass
    with pytest.raises(ScenarioError, match="It is not unpacked"):
        archive.unpack(path, tmp_path / "x", SSP)
    assert not (tmp_path / "x").exists()


def test_a_file_that_is_no_ssp_is_refused(tmp_path):
    (tmp_path / "a.ssp").write_text("no archive")
    with pytest.raises(ScenarioError, match=r"a.ssp is not an SSP. It is text."), open_ssp(tmp_path / "a.ssp"):
        pass
    with pytest.raises(ScenarioError, match=r"it holds no SystemStructure.ssd"), open_ssp(raw(tmp_path / "b.ssp", "x")):
        pass
    with pytest.raises(ScenarioError, match="there is no scenario file"):
        find_scenario("nowhere.ssp")


def test_an_archive_that_cannot_be_finished_leaves_nothing(tmp_path):
    with pytest.raises(TypeError):
        write_archive(tmp_path / "a.ssp", {"one": b"1", "two": None})
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OrchestratorError, match=r"cannot write [^\[]* Name another place with out=."), writing(tmp_path):
        write_archive(tmp_path / "file/a.ssp", {})
