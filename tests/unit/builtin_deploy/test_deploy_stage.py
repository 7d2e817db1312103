"""Exact versions, a provider for each import, and an honest word about what cannot be had."""

import json
import zipfile
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from octoform.builtin.deploy import run
from octoform.builtin.task import Task, TaskRefused

ROOT = Path(__file__).resolve().parents[3]
SCHEMA = json.loads((ROOT / "protocol/schemas/deploy.v1.schema.json").read_text())


class Index:
    """A folder of tiny packages: the only ones that the package tool can see in these tests."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()

    def add(self, name: str, version: str, needs: str = "") -> None:
        stem = f"{name.replace('-', '_')}-{version}"
        lines = ["Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}"]
        lines += [f"Requires-Dist: {needs}"] if needs else []
        with zipfile.ZipFile(self.folder / f"{stem}-py3-none-any.whl", "w") as wheel:
            wheel.writestr(f"{stem}.dist-info/METADATA", "\n".join(lines) + "\n")
            wheel.writestr(f"{stem}.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
            wheel.writestr(f"{stem}.dist-info/RECORD", "")


@pytest.fixture
def index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Index:
    monkeypatch.setenv("UV_OFFLINE", "1")
    monkeypatch.setenv("UV_FIND_LINKS", str(tmp_path / "wheels"))
    monkeypatch.setenv("UV_CACHE_DIR", str(tmp_path / "cache"))
    made = Index(tmp_path / "wheels")
    made.add("demomcp", "4.1.2", "demobase>=2")
    made.add("demomcp", "4.0")
    made.add("demobase", "2.3")
    return made


def deployed(
    folder: Path, body: str, *dependencies: str, profiles: tuple[dict[str, Any], ...] = ()
) -> tuple[str, dict[str, Any]]:
    """Summary and artifact for a server with this header and body."""
    listed = ", ".join(f'"{item}"' for item in dependencies)
    head = f'# /// script\n# requires-python = ">=3.10"\n# dependencies = [{listed}]\n# ///\n'
    source, output = folder / "server.py", folder / "deploy.json"
    source.write_text(head + body)
    summary = run(Task("deploy", source, None, output, 30, Path("/"), profiles))
    artifact = json.loads(output.read_text())
    jsonschema.validate(artifact, SCHEMA)
    return summary, artifact


def test_exact_versions_and_providers(tmp_path: Path, index: Index) -> None:
    body = "import os.path\nimport runtime\nfrom demomcp.server import X\ndef f():\n    import json\n"
    summary, artifact = deployed(tmp_path, body, "demomcp>=4.1,<4.2")
    assert summary == "1 requirement, 2 packages"
    assert artifact["status"] == "ok" and artifact["python"] == ">=3.10"
    assert artifact["requirements"] == [{"name": "demomcp", "version": "4.1.2", "why": "provides demomcp"}]
    assert {item["module"]: item["provided_by"] for item in artifact["imports"]} == {
        "json": "python",
        "os": "python",
        "demomcp": "demomcp",
        "runtime": "runtime",
    }


def test_a_module_that_is_called_otherwise_and_its_rivals(tmp_path: Path, index: Index) -> None:
    index.add("opencv-python-headless", "5.0.0.93")
    _, artifact = deployed(
        tmp_path, "import demomcp\ndef f():\n    import cv2\n", "demomcp", "OpenCV_python.headless>=4"
    )
    assert {"module": "cv2", "provided_by": "opencv-python-headless"} in artifact["imports"]
    assert artifact["requirements"][1]["version"] == "5.0.0.93"
    (line,) = artifact["conflicts"]
    assert line.startswith("opencv-python-headless was chosen and must not be installed beside")


def test_a_profile_says_which_package_its_library_is(tmp_path: Path, index: Index) -> None:
    index.add("demo-servo-library", "1.0")
    body = "import demomcp\ndef f():\n    import servolib\n"
    library = {"distribution": "Demo_Servo.library", "module": "servolib", "protocol": 0}
    profiles: tuple[dict[str, Any], ...] = (
        {"grammar": None},
        {"grammar": {"line": {}}},
        {"grammar": {"registers": {"library": library}}},
    )
    _, artifact = deployed(tmp_path, body, "demomcp", "demo-servo-library", profiles=profiles)
    assert {"module": "servolib", "provided_by": "demo-servo-library"} in artifact["imports"]
    _, artifact = deployed(tmp_path, body, "demomcp", "demo-servo-library")
    assert artifact["error"] == "nothing that the header declares is known to provide servolib"


def test_two_that_overwrite_each_other_are_an_error(tmp_path: Path, index: Index) -> None:
    index.add("opencv-python-headless", "5.0")
    index.add("opencv-python", "5.0")
    index.add("demovision", "1.0", "opencv-python")
    body = "import demovision\ndef f():\n    import cv2\n"
    summary, artifact = deployed(tmp_path, body, "demovision", "opencv-python-headless")
    assert artifact["status"] == "error" and "overwrite each other" in artifact["error"]
    assert summary.startswith("no working set: ")


def test_a_package_that_only_functions_need_may_fail(tmp_path: Path, index: Index) -> None:
    body = "import demomcp\ndef f():\n    import cv2\n"
    _, artifact = deployed(tmp_path, body, "demomcp", "opencv-python-headless")
    assert artifact["status"] == "ok"
    assert [item["name"] for item in artifact["requirements"]] == ["demomcp"]
    (failed,) = artifact["deps_failed"]
    assert failed["name"] == "opencv-python-headless" and failed["reason"]


def test_a_package_that_the_top_needs_may_not_fail(tmp_path: Path, index: Index) -> None:
    _, artifact = deployed(tmp_path, "import demomcp\n", "demomcp>=9")
    assert artifact["status"] == "error" and "demomcp" in artifact["error"]
    assert artifact["requirements"] == []


def test_an_import_that_nothing_provides_is_an_error(tmp_path: Path, index: Index) -> None:
    _, artifact = deployed(tmp_path, "import demomcp\nimport warpdrive\n", "demomcp")
    assert artifact["status"] == "error" and "warpdrive" in artifact["error"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import os\n", "no script headers"),
        ("# /// script\n# dependencies = [\n# ///\n", "not TOML"),
        ('# /// script\n# dependencies = "x"\n# ///\n', "no list of dependencies"),
        ('# /// script\n# dependencies = ["x @ file:///y"]\n# ///\n', "no name with a range"),
        ("# /// script\n# dependencies = []\n# ///\nimport (\n", "does not compile"),
    ],
)
def test_a_server_without_a_usable_header_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    source = tmp_path / "server.py"
    source.write_text(text)
    with pytest.raises(TaskRefused, match=reason):
        run(Task("deploy", source, None, tmp_path / "out.json", 30, Path("/")))


def test_a_server_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TaskRefused, match="cannot read"):
        run(Task("deploy", tmp_path / "server.py", None, tmp_path / "out.json", 30, Path("/")))
    with pytest.raises(TaskRefused, match="names none"):
        run(Task("deploy", None, None, tmp_path / "out.json", 30, Path("/")))


def test_a_user_id_without_an_account_resolves(index: Index, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody(number: int) -> None:
        raise KeyError(f"getpwuid(): uid not found: {number}")

    monkeypatch.setattr("pwd.getpwuid", nobody)
    _, artifact = deployed(tmp_path, "import demomcp\n", "demomcp>=4,<5")
    assert artifact["status"] == "ok", artifact
