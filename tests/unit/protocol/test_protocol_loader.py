"""Reading specs: the shipped ones, a project's own laid over them, and what is wrong with a spec."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from octoform.base import digest
from octoform.protocol import DUTIES, STAGES
from octoform.protocol.model import schema_dir, shipped, spec_paths
from octoform.protocol.spec_loader import load

PAGES = Path(__file__).parents[3] / "octoform" / "diagnostics" / "pages"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project's own protocol folder with a copy of one spec."""
    own = tmp_path / "protocol"
    own.mkdir()
    shutil.copy(shipped() / "identify.md", own)
    return own


def test_the_shipped_specs() -> None:
    specs, found = load(None)
    assert found == []
    assert tuple(specs) == (*STAGES, *DUTIES)
    identify = specs["identify"]
    assert identify.consumes == ("probe/output.json",)
    assert identify.produces == "identify/output.json"
    assert identify.schema == shipped() / "schemas" / "identify.v1.schema.json"
    assert identify.budget == "200s"
    assert identify.body.startswith("# IDENTIFY")
    assert identify.digest == digest.of_file(identify.path)
    assert (specs["probe"].consumes, specs["serve"].schema) == ((), None)
    assert specs["serve"].produces == "serve/server.py"


def test_a_project_folder_that_holds_nothing_uses_the_shipped_ones(tmp_path: Path) -> None:
    assert load(tmp_path / "protocol") == load(None)
    assert spec_paths(tmp_path / "protocol") == spec_paths(None)
    assert schema_dir(tmp_path / "protocol") == shipped() / "schemas"


def test_a_projects_own_spec_is_laid_over(folder: Path) -> None:
    before = load(None)[0]
    own = folder / "identify.md"
    own.write_text(own.read_text().replace("# IDENTIFY", "# My IDENTIFY"))
    specs, found = load(folder)
    assert found == []
    assert specs["identify"].path == own
    assert specs["identify"].digest != before["identify"].digest
    assert {name: specs[name] for name in STAGES if name != "identify"} == {
        name: before[name] for name in STAGES if name != "identify"
    }


def test_line_ends_are_no_change(folder: Path) -> None:
    own = folder / "identify.md"
    own.write_bytes(own.read_bytes().replace(b"\n", b"\r\n"))
    assert load(folder)[0]["identify"].digest == load(None)[0]["identify"].digest


@pytest.mark.parametrize(
    ("old", "new", "code", "line", "hint"),
    [
        ("stage: identify", "stage: identfy", "PROTOCOL-FIELD", 2, "stage: identify"),
        ("consumes: [probe/output.json]", "consumes: []", "PROTOCOL-FIELD", 3, "[probe/output.json]"),
        ("produces:", "produce:", "PROTOCOL-FIELD", 4, "'produces'"),
        ("schema: schemas/", "schema: other/", "PROTOCOL-FIELD", 5, "schemas/identify.v1.schema.json"),
        ("budget: 200s", "budget: soon", "PROTOCOL-FIELD", 6, "200s"),
        ("budget: 200s", "budget: 200", "PROTOCOL-FIELD", 6, "200s"),
        ("budget: 200s", "budget: [", "PROTOCOL-FRONT-MATTER", 7, None),
    ],
)
def test_a_wrong_field_is_told_with_its_place(
    folder: Path, old: str, new: str, code: str, line: int, hint: str | None
) -> None:
    own = folder / "identify.md"
    own.write_text(own.read_text().replace(old, new, 1))
    specs, found = load(folder)
    assert "identify" not in specs
    assert found[0].code == code
    assert found[0].span is not None and found[0].span.line == line
    assert hint is None or hint in str(found[0].hint)
    assert (PAGES / f"{code}.md").read_text().startswith(f"# {code}: ")


def test_all_problems_of_all_specs_come_at_once(folder: Path) -> None:
    (folder / "identify.md").write_text("---\nstage: x\nunknown: 1\n---\ntext\n")
    (folder / "probe.md").write_text("no front matter\n")
    specs, found = load(folder)
    assert set(specs) == {"interface", "serve", "deploy", *DUTIES}
    assert {item.path for item in found} == {str(folder / "identify.md"), str(folder / "probe.md")}
    assert len(found) >= 5


def test_a_spec_without_text_is_refused(folder: Path) -> None:
    own = folder / "identify.md"
    own.write_text(own.read_text().partition("# IDENTIFY")[0])
    assert [item.code for item in load(folder)[1]] == ["PROTOCOL-EMPTY"]


@pytest.mark.parametrize("target", [None, "nowhere.md", "identify.md"])
def test_a_folder_or_a_link_to_nowhere_is_not_replaced_by_the_shipped_spec(folder: Path, target: str | None) -> None:
    own = folder / "identify.md"
    own.unlink()
    own.mkdir() if target is None else own.symlink_to(target)
    assert [(item.code, item.path) for item in load(folder)[1]] == [("PROTOCOL-FRONT-MATTER", str(own))]


def test_a_link_to_nowhere_is_not_replaced_by_the_shipped_schemas(folder: Path) -> None:
    (folder / "schemas").symlink_to("nowhere")
    assert {item.code for item in load(folder)[1]} == {"PROTOCOL-NO-SCHEMA"}


def test_a_misspelt_file_is_a_warning(folder: Path) -> None:
    (folder / "identify.md").rename(folder / "identfy.md")
    (folder / "README.md").write_text("notes")
    specs, found = load(folder)
    assert tuple(specs) == (*STAGES, *DUTIES)
    assert [(item.code, item.severity.value, item.hint) for item in found] == [
        ("PROTOCOL-UNUSED", "warning", "did you mean identify.md?")
    ]


def test_own_schemas_must_be_complete(folder: Path) -> None:
    shutil.copytree(shipped() / "schemas", folder / "schemas")
    assert load(folder)[1] == []
    assert schema_dir(folder) == folder / "schemas"
    (folder / "schemas" / "deploy.v1.schema.json").unlink()
    specs, found = load(folder)
    assert [item.code for item in found] == ["PROTOCOL-NO-SCHEMA"]
    assert "deploy" not in specs


@pytest.mark.parametrize("stands", [lambda path: path.symlink_to("nowhere"), Path.touch], ids=["link", "file"])
def test_what_is_no_folder_is_not_replaced_by_the_shipped_specs(
    tmp_path: Path, stands: Callable[[Path], object]
) -> None:
    stands(tmp_path / "protocol")
    found = load(tmp_path / "protocol")[1]
    assert [(item.code, item.path) for item in found] == [("PROTOCOL-FRONT-MATTER", str(tmp_path / "protocol"))]
