"""A second build compiles what changed and nothing else, and gives the same bytes."""

import hashlib

import pytest
from gossamer_fmus import build, build_all
from gossamer_fmus import compiler as fmu_compiler
from gossamer_models import compiler


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """What is compiled, in order, by a compiler that returns a digest; the cache is empty."""
    calls = []

    def compile_shared(files, source, library, options, what):
        calls.append(f"{library} for {what}")
        return hashlib.sha256(repr((sorted(files.items()), source, library, options)).encode()).digest()

    monkeypatch.setattr(fmu_compiler, "compile_shared", compile_shared)
    monkeypatch.setattr(build, "descriptions", lambda _model, _libraries: {})  # a digest has no addresses
    monkeypatch.setattr(compiler, "_usual_folder", lambda: tmp_path / "cache")
    compiler.cache_folder.cache_clear()
    yield calls
    compiler.cache_folder.cache_clear()


LINUX, WINDOWS = "sensor.so for x86_64-linux-gnu.2.17", "sensor.dll for x86_64-windows-gnu"


def test_a_second_build_compiles_nothing_and_gives_the_same_bytes(tmp_path, compiled):
    said = []
    first, second = (
        build_all(tmp_path / name, ["sensor"], native=True, platforms=["linux64", "win64"], progress=said.append)["sensor"]
        for name in ("first", "second")
    )
    assert sorted(compiled) == [WINDOWS, LINUX]
    assert sorted(said) == ["sensor for linux64", "sensor for win64"]
    assert first.read_bytes() == second.read_bytes()


def test_what_depends_on_a_change_is_compiled_again_and_the_rest_is_not(tmp_path, compiled):
    build_all(tmp_path, ["sensor", "compensator"], native=True, platforms=["linux64"])
    compiled.clear()
    build_all(tmp_path, ["sensor", "compensator"], native=True, platforms=["linux64"], scales=(200.0, 50.0, 0.3))
    assert sorted(compiled) == ["compensator.so for x86_64-linux-gnu.2.17", LINUX]
    compiled.clear()
    build_all(tmp_path, ["sensor"], native=True, platforms=["linux64", "win64"])  # as at first, and a new platform
    assert compiled == [WINDOWS]
    build_all(tmp_path, ["sensor"], native=True, platforms=["win64"], fmi=3)
    assert compiled == [WINDOWS, WINDOWS]


def test_another_compiler_compiles_again(tmp_path, compiled, monkeypatch):
    build_all(tmp_path, ["sensor"], native=True, platforms=["linux64"])
    monkeypatch.setattr("gossamer_models.compiler.version", lambda _: "0.18.0")
    build_all(tmp_path, ["sensor"], native=True, platforms=["linux64"])
    assert compiled == [LINUX, LINUX]


def test_a_damaged_library_is_compiled_again(tmp_path, compiled, caplog):
    path = build_all(tmp_path, ["sensor"], native=True, platforms=["linux64"])["sensor"]
    whole = path.read_bytes()
    (file,) = (tmp_path / "cache").iterdir()
    file.write_bytes(b"half")
    build_all(tmp_path, ["sensor"], native=True, platforms=["linux64"])
    assert path.read_bytes() == whole
    assert compiled == [LINUX, LINUX]
    assert f"{file} is damaged" in caplog.text
