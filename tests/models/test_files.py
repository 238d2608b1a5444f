"""Whole files: what was good stays good until its successor is complete."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest
from gossamer_files import replacing, replacing_all, uninterrupted
from gossamer_models import ArtifactError
from gossamer_models.artifacts import read_arrays, read_artifact, write_artifact


def test_a_file_appears_when_it_is_complete_in_a_folder_that_is_made(tmp_path):
    path = tmp_path / "new/folder/answer.json"
    with replacing(path) as unfinished:
        unfinished.write_text("42")
        assert not path.exists()
        assert (unfinished.parent, unfinished.suffix) == (path.parent, ".json")
    assert path.read_text() == "42"
    assert list(path.parent.iterdir()) == [path]


def test_what_was_there_stays_if_the_writer_fails(tmp_path):
    path = tmp_path / "answer.json"
    path.write_text("good")

    def write():
        with replacing(path) as unfinished:
            unfinished.write_text("hal")
            raise OSError(28, "no space")

    with pytest.raises(OSError, match="no space"):
        write()
    assert path.read_text() == "good"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_is_followed_and_a_device_written_to(tmp_path):
    (tmp_path / "real.json").write_text("good")
    (tmp_path / "link.json").symlink_to("real.json")
    with replacing(tmp_path / "link.json") as unfinished:
        unfinished.write_text("better")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "real.json").read_text() == "better"
    null = type(tmp_path)(os.devnull)
    with replacing(null) as unfinished:
        unfinished.write_text("nothing")
    assert not null.is_file()


def test_what_a_killed_writer_left_is_removed_later(tmp_path):
    path, old, new = (tmp_path / name for name in ("a.json", ".a.01234567.unfinished.json", ".a.89.unfinished.json"))
    for file in (old, new):
        file.write_text("hal")
    os.utime(old, times=(time.time() - 7200.0,) * 2)
    with replacing(path) as unfinished:
        unfinished.write_text("whole")
    assert sorted(tmp_path.iterdir()) == sorted([path, new])  # another process may still write the other one


@pytest.mark.parametrize("calls", range(1, 8))
def test_a_card_is_never_without_its_arrays(tmp_path, monkeypatch, calls):
    """The writer ends at each of the moments at which a name in the folder changes."""
    path, before = tmp_path / "sensor.json", {"a": np.arange(3.0)}
    write_artifact(path, "test", 1, {}, {"n": 1}, before)
    left = calls

    class Killed(BaseException):
        pass

    def counted(function):
        def call(*arguments, **options):
            nonlocal left
            left -= 1
            if left <= 0:
                raise Killed
            return function(*arguments, **options)

        return call

    with monkeypatch.context() as patch:
        for name in ("replace", "fsync", "unlink"):
            patch.setattr(f"os.{name}", counted(getattr(os, name)))
        with pytest.raises(Killed):
            write_artifact(path, "test", 1, {}, {"n": 2}, {"a": np.arange(9.0)})
    card = read_artifact(path, "test", 1)
    assert read_arrays(path, card)["a"].size == {1: 3, 2: 9}[card["n"]]
    write_artifact(path, "test", 1, {}, {"n": 3}, {"a": np.arange(4.0)})
    card = read_artifact(path, "test", 1)
    assert read_arrays(path, card)["a"].size == 4


@pytest.mark.parametrize(("content", "why"), [
    ("[" * 100_000, "it is nested too deeply"),
    ('{"version": 1}', "it lacks 'schema'"),
    (None, "no such file or directory"),
    ("{}".encode("utf-16"), "it is no text in UTF-8"),
])  # fmt: skip
def test_an_artifact_that_cannot_be_read_is_refused_in_words(tmp_path, content, why):
    path = tmp_path / "sensor.json"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ArtifactError, match=f"sensor.json: {why}. Make it again"):
        read_artifact(path, "test", 1)


def test_a_signal_waits_until_files_that_belong_together_are_written(tmp_path):
    def write():
        with uninterrupted(tmp_path), replacing_all([tmp_path / "a", tmp_path / "b"]) as (first, second):
            first.write_text("new")
            signal.raise_signal(signal.SIGINT)
            second.write_text("new")

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job begins by ignoring it
    with pytest.raises(KeyboardInterrupt):
        write()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.skipif(os.name != "posix", reason="locks folders as POSIX does")
def test_two_commands_that_write_into_one_folder_do_so_one_after_the_other(tmp_path):
    begun, waited = threading.Event(), threading.Event()

    def first():
        with uninterrupted(tmp_path):
            (tmp_path / "a").write_text("first")
            begun.set()
            waited.wait(0.3)
            (tmp_path / "b").write_text("first")

    def second():
        begun.wait()
        with uninterrupted(tmp_path):
            for name in ("a", "b"):
                (tmp_path / name).write_text("second")
        waited.set()

    threads = [threading.Thread(target=each) for each in (first, second)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "second", "b": "second"}


@pytest.mark.skipif(os.name != "posix", reason="locks folders as POSIX does")
def test_who_holds_a_folder_for_ever_holds_up_nobody_and_is_told_of(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr("gossamer_files.PATIENCE", 1)
    with uninterrupted(tmp_path), uninterrupted(tmp_path):
        (tmp_path / "a").write_text("written")
    assert "another command has kept" in caplog.text


def test_of_files_that_belong_together_all_are_written_or_none(tmp_path):
    def write():
        with replacing_all([tmp_path / name for name in ("a", "b")]) as places:
            for place in places:
                place.write_text("new")
            raise OSError(28, "no space")

    for name in ("a", "b"):
        (tmp_path / name).write_text("old")
    with pytest.raises(OSError, match="no space"):
        write()
    assert [(tmp_path / name).read_text() for name in ("a", "b")] == ["old", "old"]


def test_files_take_their_places_together_or_none_does(tmp_path):
    paths = [tmp_path / name for name in "abc"]
    for path in paths:
        path.write_text("old")

    def write_two():
        with replacing_all(paths) as places:
            places[0].write_text("new")
            places[2].write_text("new")

    with pytest.raises(OSError, match="b"):
        write_two()
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == ["old"] * 3
