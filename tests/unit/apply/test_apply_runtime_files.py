"""What stands beside a generated server: every module of the runtime and of its base, as text, and nothing else."""

import subprocess
import sys
from pathlib import Path

import pytest

from octoform import runtime
from octoform.apply.stage.artifact_writer import runtime_files
from octoform.state.accepted import accept
from octoform.state.layout import Layout

SOURCE = Path(runtime.__file__).parent
BASE = SOURCE.parent / "base"


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(tmp_path, "bench")


def test_the_files_are_those_of_the_runtime_and_the_base_that_it_needs() -> None:
    files = runtime_files()
    assert files["runtime/base/files.py"] == (BASE / "files.py").read_bytes()
    links = {path.name for path in (SOURCE / "base").iterdir() if path.is_symlink()}
    assert links == {"clock.py", "files.py", "locks.py", "processes.py", "quantities.py", "serials.py", "shape.py"}
    assert {name for name in files if name.startswith("runtime/base/")} == {
        f"runtime/base/{name}" for name in (*links, "__init__.py")
    }
    assert {name for name in files if name.count("/") == 1} == {f"runtime/{path.name}" for path in SOURCE.glob("*.py")}


def test_they_take_the_place_of_a_former_version_s_which_lay_in_one_folder(layout: Layout) -> None:
    flat = {f"runtime/{name}.py": b"FORMER = True\n" for name in ("__init__", "devices", "plainfiles", "serials")}
    assert accept(layout, "serve", {"server.py": b"import runtime\n", **flat}) == []
    assert accept(layout, "serve", {"server.py": b"import runtime\n", **runtime_files()}) == []
    there = {path.relative_to(layout.runtime.parent).as_posix() for path in layout.runtime.rglob("*.py")}
    assert there == runtime_files().keys()


def test_they_are_imported_without_octoform(layout: Layout) -> None:
    assert accept(layout, "serve", {"server.py": b"import runtime\n", **runtime_files()}) == []
    code = "import runtime, sys; print(sys.modules['runtime.base.files'].__file__, 'octoform' in sys.modules)"
    command = [sys.executable, "-S", "-B", "-c", code]
    done = subprocess.run(command, cwd=layout.runtime.parent, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(layout.runtime / "base/files.py"), "False"]
