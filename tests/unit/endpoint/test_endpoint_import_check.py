"""A server is imported where it will be served, under watch."""

from pathlib import Path

import pytest
from unit.endpoint.endpoint_servers import GOOD, HEADER, lay_out, tool

from octoform.endpoint.environment.import_check import ImportReport, check_import, judge_import
from octoform.endpoint.environment.model import Environment


def imported(
    serving: Environment, folder: Path, source: str, timeout: float = 60.0, **environment: str
) -> tuple[ImportReport, list[str]]:
    report = check_import(serving.python, lay_out(folder, source), timeout, environment)
    return report, [item.code for item in judge_import(report)]


def test_a_good_server_shows_its_tools_as_a_client_sees_them(serving: Environment, tmp_path: Path) -> None:
    report, codes = imported(serving, tmp_path, GOOD)
    assert codes == []
    assert report.name == "bench"
    assert [item.name for item in report.tools] == ["read_clock", "read_voltage"]
    voltage = report.tools[1]
    assert voltage.input_schema["properties"] == {"channel": {"type": "integer"}}
    assert voltage.input_schema["required"] == ["channel"]
    assert voltage.output_schema is not None and voltage.output_schema["type"] == "object"
    assert voltage.annotations is not None and voltage.annotations["readOnlyHint"] is True
    assert voltage.description == "A voltage, in volts."
    assert list(tmp_path.rglob("__pycache__")) == [], "the committed folder stays clean"


TOUCHES = (
    ('open("{sysroot}/dev/video0", "rb")', "ENDPOINT-IMPORT-DEVICE", "/dev/video0"),
    ('import os; os.open("{sysroot}/dev/video0", os.O_RDWR)', "ENDPOINT-IMPORT-DEVICE", "/dev/video0"),
    ('from pathlib import Path; Path("/dev/tty").read_bytes()', "ENDPOINT-IMPORT-DEVICE", "/dev/tty"),
    ('import socket; socket.create_connection(("127.0.0.1", 9))', "ENDPOINT-IMPORT-SOCKET", "127.0.0.1"),
    ('import socket; socket.socket().bind(("127.0.0.1", 0))', "ENDPOINT-IMPORT-SOCKET", "bind"),
    ('import subprocess; subprocess.run(["true"])', "ENDPOINT-IMPORT-PROCESS", "true"),
    ('import os; os.system("true")', "ENDPOINT-IMPORT-PROCESS", "true"),
)


def test_what_a_server_may_not_touch_at_import_is_stopped_and_placed(serving: Environment, tmp_path: Path) -> None:
    node = tmp_path / "root" / "dev" / "video0"
    node.parent.mkdir(parents=True)
    node.touch()
    sysroot = str(tmp_path / "root")
    source, lines = HEADER, []
    for text, _, _ in TOUCHES:
        source += (
            f"\ntry:\n    {text.format(sysroot=sysroot)}\n    print('it went through')\nexcept OSError:\n    pass\n"
        )
        lines.append(len(source.splitlines()) - 3)
    report = check_import(serving.python, lay_out(tmp_path / "x", source), 60.0, {"OCTOFORM_SYSROOT": sysroot})
    problems = judge_import(report)
    assert [item.code for item in problems] == [code for _, code, _ in TOUCHES]
    assert [item.span.line for item in problems if item.span] == lines
    for problem, (_, _, message) in zip(problems, TOUCHES, strict=True):
        assert message in str(problem.detail)


def test_the_refusal_itself_is_no_second_fault(serving: Environment, tmp_path: Path) -> None:
    report, codes = imported(serving, tmp_path, GOOD + "\nopen('/dev/tty')\n")
    assert codes == ["ENDPOINT-IMPORT-DEVICE"]
    assert report.fault is not None


def test_a_device_held_open_by_a_c_library_is_found(serving: Environment, tmp_path: Path) -> None:
    node = tmp_path / "root" / "dev" / "video0"
    node.parent.mkdir(parents=True)
    node.touch()
    source = GOOD + f"\nimport ctypes\nctypes.CDLL(None).open({str(node)!r}.encode(), 0)\n"
    _, codes = imported(serving, tmp_path / "x", source, OCTOFORM_SYSROOT=str(tmp_path / "root"))
    assert codes == ["ENDPOINT-IMPORT-DEVICE"]


def test_harmless_nodes_and_library_look_ups_are_allowed(serving: Environment, tmp_path: Path) -> None:
    source = GOOD + "\nimport ctypes.util\nctypes.util.find_library('c')\nopen('/dev/null').close()\n"
    assert imported(serving, tmp_path, source)[1] == []


def test_printing_is_found_whoever_prints(serving: Environment, tmp_path: Path) -> None:
    report, codes = imported(serving, tmp_path, GOOD + "\nimport os\nos.write(1, b'driver 1.0 ready')\n")
    assert codes == ["ENDPOINT-IMPORT-STDOUT"]
    assert "driver 1.0 ready" in report.violations[0].detail
    assert len(report.tools) == 2


def test_a_hanging_import_is_ended(serving: Environment, tmp_path: Path) -> None:
    report, codes = imported(serving, tmp_path, "import time\n\ntime.sleep(600)\n", timeout=1.5)
    assert codes == ["ENDPOINT-IMPORT-TIMEOUT"]
    assert report.seconds < 10


@pytest.mark.parametrize(
    ("source", "kind", "line"),
    [
        ("import fastmcp\nimport no_such_library\n", "ModuleNotFoundError", 2),
        ("import fastmcp\n\nx = fastmcp.nothing\n", "AttributeError", 3),
        ("def f(:\n", "SyntaxError", 1),
        ("import sys\nsys.exit(0)\n", "SystemExit", 2),
        ("x = 1\n", "LookupError", None),
    ],
)
def test_a_failing_import_names_class_and_line(
    serving: Environment, tmp_path: Path, source: str, kind: str, line: int | None
) -> None:
    report, codes = imported(serving, tmp_path, source)
    assert codes == ["ENDPOINT-IMPORT-FAILED"]
    assert report.fault is not None
    assert (report.fault.type, report.fault.line) == (kind, line)


def test_a_crash_of_the_interpreter_is_a_report_too(serving: Environment, tmp_path: Path) -> None:
    report, codes = imported(serving, tmp_path, "import os\nos.abort()\n")
    assert codes == ["ENDPOINT-IMPORT-FAILED"]
    assert report.fault is not None and report.fault.type == "Crash"


def test_a_library_missing_for_one_tool_does_not_stop_the_import(serving: Environment, tmp_path: Path) -> None:
    report, codes = imported(serving, tmp_path, HEADER + tool("import no_such_library\nreturn 1.0"))
    assert codes == []
    assert len(report.tools) == 2
