"""The entry point: speed, exit statuses, errors as text."""

import os
import signal
import statistics
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

import prehensile
from prehensile.cli import main as cli
from prehensile.errors import Finding, InputError


def call(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "prehensile", *arguments], capture_output=True, text=True, **options
    )


@pytest.fixture
def command(monkeypatch):
    """Adds a command "probe", whose run() is the given function."""

    def add(run):
        module = types.ModuleType("prehensile.cli.probe")
        vars(module)["add_arguments"] = lambda parser: parser.add_argument("--x", type=int)
        vars(module)["run"] = run
        monkeypatch.setitem(sys.modules, "prehensile.cli.probe", module)
        monkeypatch.setitem(cli.COMMANDS, "probe", ("probe", "a probe"))

    return add


def test_help_names_every_command():
    done = call("--help")
    assert done.returncode == 0
    for name, (_, text) in cli.COMMANDS.items():
        assert f"    {name} " in done.stdout
        assert text in done.stdout


def test_help_imports_no_drake():
    code = (
        "import sys\n"
        "from prehensile.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'pydrake', 'numpy', 'scipy', 'PIL', 'yaml', 'rich'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_help_is_fast():
    """Costs at most 0.2 s more than Python itself takes to start (0.3 s in all on a free core)."""

    def seconds(*command):
        samples = []
        for _ in range(7):
            before = os.times()
            subprocess.run([sys.executable, *command], capture_output=True, check=True)
            after = os.times()
            # Processor time of the child, so that other load on the machine does not enter.
            samples.append(
                after.children_user
                + after.children_system
                - before.children_user
                - before.children_system
            )
        return statistics.median(samples)

    assert seconds("-m", "prehensile", "--help") < seconds("-c", "pass") + 0.2


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_help_of_each_command(name):
    done = call(name, "--help")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: prehensile {name}")
    assert "Traceback" not in done.stderr


def test_version():
    assert call("--version").stdout.strip() == prehensile.__version__


@pytest.mark.parametrize("arguments", [(), ("frobnicate",), ("doctor", "--frobnicate")])
def test_unknown_words_are_bad_input(arguments):
    done = call(*arguments)
    assert done.returncode == 2
    assert "usage: prehensile" in done.stderr
    assert "Traceback" not in done.stderr


def test_console_script_is_the_same(tmp_path):
    script = Path(sys.executable).with_name("prehensile")
    if not script.exists():
        pytest.skip("the package is not installed beside this Python")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.strip() == prehensile.__version__


def test_input_errors_are_told_without_traceback(command, capsys):
    def run(args):
        raise InputError(
            Finding("no such width", "give one above 0", "a.yaml", 3, "cameras.c.width"),
            Finding("no such height"),
        )

    command(run)
    assert cli.main(["probe"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "prehensile: a.yaml:3: cameras.c.width: no such width (give one above 0)",
        "prehensile: no such height",
    ]


@pytest.mark.parametrize("arguments", [["--debug", "probe"], ["probe", "--debug"]])
def test_debug_shows_where_it_happened(command, arguments):
    def run(args):
        raise InputError("bad")

    command(run)
    with pytest.raises(InputError):
        cli.main(arguments)


def test_unexpected_errors_are_told_as_such(command, capsys):
    def run(args):
        raise RuntimeError("the plant is on fire")

    command(run)
    assert cli.main(["probe"]) == 3
    error = capsys.readouterr().err
    assert "RuntimeError: the plant is on fire" in error
    assert "--debug" in error


def test_arguments_and_exit_status_go_through(command):
    command(lambda args: args.x)
    assert cli.main(["probe", "--x", "1"]) == 1


def test_interrupt_gives_130():
    """Ctrl-C while a command runs, as a shell would send it."""
    code = (
        "import signal, sys, time, types\n"
        "from prehensile.cli import main as cli\n"
        # A shell's background job, as the tests may be, ignores interrupts and hands that on.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "probe = types.ModuleType('prehensile.cli.probe')\n"
        "probe.add_arguments = lambda parser: None\n"
        "def run(args):\n    print('ready', flush=True)\n    time.sleep(30)\n"
        "probe.run = run\n"
        "sys.modules['prehensile.cli.probe'] = probe\n"
        "cli.COMMANDS['probe'] = ('probe', '')\n"
        "sys.exit(cli.main(['probe']))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=20)
    assert process.returncode == 130
    assert error == "prehensile: interrupted\n"


def test_reader_that_goes_away_is_no_error():
    process = subprocess.Popen(
        [sys.executable, "-m", "prehensile", "models", "list"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.close()
    deadline = time.monotonic() + 30
    while process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert process.stderr is not None
    assert process.stderr.read() == ""
