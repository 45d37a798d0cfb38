"""Whatever happens to a scenario file, reading it gives a scenario or an InputError."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from prehensile.errors import InputError
from prehensile.station.scenario_file import load_scenario, loads_scenario

VALID = load_scenario("pick_brick").file.read_text()  # type: ignore[union-attr]
LINES = VALID.splitlines()

NASTY = [
    "", "~", "{}", "[]", "[[]]", "[1, 2, 3]", ".nan", "-.inf", ".inf", "0", "-1", "1e308", "1e999",
    "9" * 400, "true", "no", "2026-01-01", "!Rpy {}", "!Rpy {deg: [1]}", "!Uniform {}", "!!int x",
    "!!binary '='", "!!python/object:os.system {}", "!<tag:a> {}", "*gone", "&a [*a]", "<<: 3",
    "'", '"\\x"', "\t", "\0", "\ud7ff", "{a: 1, a: 2}", "- - -", "? x", "|", ">", "%YAML 9.9",
    "---", "...", "package://", "package://prehensile/", "package://prehensile/iiwa7",
    "file:///dev/zero", "file:///etc/passwd", "a::b::c", "::", "world", "iiwa::", "::body",
    "{base_frame: {}}", "{x: .nan}", "!IiwaDriver {}", "!SchunkWsgDriver {pid_gains: []}",
]  # fmt: skip


@st.composite
def mutations(draw: st.DrawFn) -> str:
    """The valid file after a few blows."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 4))):
        i = draw(st.integers(0, len(lines) - 1))
        blow = draw(st.sampled_from(["drop", "twice", "value", "key", "indent", "swap", "cut"]))
        key, colon, _value = lines[i].partition(":")
        if blow == "drop":
            del lines[i]
        elif blow == "twice":
            lines.insert(draw(st.integers(0, len(lines))), lines[i])
        elif blow == "value" and colon:
            lines[i] = f"{key}: {draw(st.sampled_from(NASTY))}"
        elif blow == "key" and colon:
            name = draw(st.sampled_from([*NASTY, "add_model", "name", "file", "X_PB", "rotation"]))
            indent = key[: len(key) - len(key.lstrip(" -"))]
            lines[i] = f"{indent}{name}:{_value}"
        elif blow == "indent":
            lines[i] = " " * draw(st.integers(0, 8)) + lines[i].strip()
        elif blow == "swap":
            j = draw(st.integers(0, len(lines) - 1))
            lines[i], lines[j] = lines[j], lines[i]
        elif blow == "cut":
            at = draw(st.integers(0, len(lines[i])))
            lines[i] = lines[i][:at] + draw(st.text(max_size=6)) + lines[i][at:]
        if not lines:
            break
    return "\n".join(lines)


def read(text: str) -> None:
    try:
        loads_scenario(text)
        return
    except InputError as error:
        findings = error.findings
    assert findings
    assert all(finding.message for finding in findings)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(mutations())
def test_a_mutated_file_gives_a_scenario_or_an_input_error(text):
    read(text)


@settings(max_examples=60, deadline=None)
@given(st.text(alphabet=st.sampled_from("ab:-{}[]&*!|>'\"#%@`, \n\t~<1.e"), max_size=60))
def test_arbitrary_text_gives_a_scenario_or_an_input_error(text):
    read(text)


@pytest.mark.slow
@settings(max_examples=1000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(mutations())
def test_many_mutated_files_give_a_scenario_or_an_input_error(text):
    read(text)
