"""``prehensile doctor`` sees what is there and what is not."""

import argparse
import os
import platform
import stat
import sys

import pytest

from prehensile.cli import doctor


@pytest.fixture
def empty_path(monkeypatch, tmp_path):
    """A machine with no programs on its PATH; returns the folder that is its PATH."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    return tmp_path


def put_program(folder, name, text):
    path = folder / name
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def test_this_machine_has_what_is_needed(capsys):
    status = doctor.run(argparse.Namespace())
    text = capsys.readouterr().out
    assert status == 0, text
    for subject in ("Python", "Drake", "Compiled kernels", "Embedded models", "Rendering"):
        assert f"✓ {subject}" in text
    assert platform.python_version() in text


def test_no_compiler(empty_path):
    check = doctor.check_compiler()
    assert check.missing
    assert not check.needed
    assert "none" in check.text


def test_compiler_that_is_too_old(empty_path):
    put_program(empty_path, "g++", "#!/bin/sh\nexit 1\n")
    check = doctor.check_compiler()
    assert check.missing
    assert str(empty_path / "g++") in check.text


def test_no_browser_and_no_display(empty_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert doctor.check_browser().missing
    assert not doctor.check_browser().needed
    if sys.platform == "linux":
        assert doctor.check_display().missing
        monkeypatch.setenv("DISPLAY", ":7")
        assert ":7" in doctor.check_display().text


def test_browser_is_found(empty_path):
    put_program(empty_path, "firefox", "#!/bin/sh\n")
    assert doctor.check_browser() == doctor.Check("Web browser", "firefox")


def test_something_needed_is_missing(monkeypatch, capsys):
    def look():
        """Legs"""
        return doctor.Check("Legs", "there are none", True, True, "Grow some.")

    monkeypatch.setattr(doctor, "CHECKS", (look,))
    assert doctor.run(argparse.Namespace()) == 1
    text = capsys.readouterr().out
    assert "Grow some." in text
    assert "Missing: Legs." in text


def test_a_crash_of_the_renderer_is_an_answer(monkeypatch):
    probe = doctor._failure_of
    monkeypatch.setattr(
        doctor, "_failure_of", lambda code: probe("import os; os.kill(os.getpid(), 11)")
    )
    check = doctor.check_rendering()
    assert check.missing
    assert check.needed
    assert "signal 11" in check.text


def test_an_exception_is_told_by_its_last_line():
    assert doctor._failure_of("raise ValueError('no GL')") == "ValueError: no GL"
    assert doctor._failure_of("raise SystemExit(4)") == "exit status 4"
    assert doctor._failure_of("pass") is None


def test_models_that_are_gone(monkeypatch):
    monkeypatch.setattr("prehensile.models.registry.list_models", list)
    check = doctor.check_models()
    assert check.missing
    assert check.needed


def test_cores_are_those_of_this_process():
    if not hasattr(os, "sched_getaffinity"):
        pytest.skip("this system does not say which cores a process may use")
    assert doctor.check_cores().text.startswith(str(len(os.sched_getaffinity(0))))
