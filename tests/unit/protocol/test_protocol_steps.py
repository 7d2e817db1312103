"""Privileged steps as files: the shipped three, a project's own beside and in place of them, what is wrong with one."""

import json
import re
from pathlib import Path

import pytest

from octoform.diagnostics import Diagnostic
from octoform.protocol import Prompt, Proof, Step, own_path, render_prompt, step_paths
from octoform.protocol.model import shipped
from octoform.protocol.spec_loader import load_step

SHIPPED = {name: load_step(name, path, None)[0] for name, path in step_paths(None).items()}
LAMP = """---
step: lamp
about: prove that the lamp dims
profile: null
proof: {kind: reading, minimum: 5, unit: percent}
consumes: [identify/output.json, interface/output.json, serve/server.py]
produces: steps/lamp/output.json
schema: schemas/step.v1.schema.json
---
# LAMP

Dim it.
"""


def shipped_step(name: str) -> Step:
    step = SHIPPED[name]
    assert step is not None
    return step


def load(tmp_path: Path, text: str) -> tuple[Step | None, list[Diagnostic]]:
    folder = tmp_path / "protocol"
    path = folder / "privileged" / "lamp.md"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return load_step("lamp", path, folder)


def test_the_shipped_steps() -> None:
    assert tuple(SHIPPED) == ("arm", "perceive", "rail")
    arm, rail, perceive = (shipped_step(name) for name in ("arm", "rail", "perceive"))
    assert (arm.node, arm.profile, arm.spec.stage) == ("step.arm", "so-arm101", "step.arm")
    assert arm.proof == Proof("reading", 50.0, "raw", 2.0)
    assert (rail.profile, rail.proof.kind) == ("camera-rail", "view")
    assert (perceive.profile, perceive.proof) == (None, Proof("frame", 0.0, "", 2.0))
    assert arm.spec.schema == shipped() / "schemas" / "step.v1.schema.json"
    assert arm.spec.produces == "steps/arm/output.json"


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_a_shipped_step_names_no_system_and_explains_each_member(name: str) -> None:
    step = shipped_step(name)
    text = step.spec.text
    assert max(len(line) for line in text.splitlines()) <= 120
    assert [word for word in ("/dev/", "ttyACM", "v4l2", "video4linux", "{{") if word in text] == []
    assert step.spec.schema is not None
    required = set(json.loads(step.spec.schema.read_text())["required"]) - {"format", "step"}
    assert sorted(member for member in required if not re.search(rf"`{member}`", step.spec.body)) == []
    assert "octoform" in step.spec.body and "live endpoint" in step.spec.body


def test_a_project_adds_a_step_and_replaces_a_shipped_one_by_files_alone(tmp_path: Path) -> None:
    step, found = load(tmp_path, LAMP)
    assert found == [] and step is not None
    assert (step.about, step.profile) == ("prove that the lamp dims", None)
    assert step.proof == Proof("reading", 5.0, "percent", 2.0)
    folder = tmp_path / "protocol"
    (folder / "privileged" / "arm.md").write_text("mine")
    (folder / "privileged" / "README.md").write_text("about them")
    paths = step_paths(folder)
    assert tuple(paths) == ("arm", "lamp", "perceive", "rail")
    assert paths["arm"] == folder / "privileged" / "arm.md"
    assert paths["rail"] == shipped() / "privileged" / "rail.md"


@pytest.mark.parametrize(
    ("old", "new", "line", "summary", "hint"),
    [
        ("step: lamp", "step: lmap", 2, "does not fit the step lamp", "write step: lamp"),
        ("about: prove that the lamp dims", "about: ''", 3, "'about' is no short sentence", "write about:"),
        ("profile: null", "profile: The Lamp", 4, "'profile' names none", "profile: null"),
        ("profile: null\n", "", 2, "'profile' names none", "profile: null"),
        ("profile: null", "profil: null", 4, "'profil' is no field of a step", "did you mean 'profile'?"),
        ("proof: {", "proof: hope # {", 5, "'proof' is missing or no mapping", "write proof:"),
        ("kind: reading", "kind: hearing", 5, "'kind' is no kind of hardware test", "reading, view, frame"),
        ("minimum: 5", "minimum: 0", 5, "'minimum' is no number above 0", "minimum: 50"),
        ("minimum: 5", "minimum: true", 5, "'minimum' is no number above 0", "minimum: 50"),
        ("minimum: 5", "minimun: 5", 5, "'minimun' is no field of a hardware test", "did you mean 'minimum'?"),
        ("kind: reading", "kind: frame", 5, "kind frame has no 'minimum'", "nothing moves"),
        ("unit: percent", "settle: 2", 5, "'settle' is no time", "1h30m"),
        ("unit: percent", "settle: 2m", 5, "'settle' is no time", "at most 60s"),
        ("interface/output.json, ", "", 6, "'consumes' does not fit", "write consumes: [identify/output.json,"),
        ("produces: steps/lamp", "produces: lamp", 7, "'produces' does not fit", "steps/lamp/output.json"),
        ("---\n# LAMP", "budget: soon\n---\n# LAMP", 9, "'budget' is no time", "1h30m"),
        ("step: lamp", "step: &a lamp", 2, "anchors and aliases", None),
    ],
)
def test_a_wrong_field_is_told_with_its_place(
    tmp_path: Path, old: str, new: str, line: int, summary: str, hint: str | None
) -> None:
    assert old in LAMP
    step, found = load(tmp_path, LAMP.replace(old, new))
    assert step is None
    item = next(one for one in found if summary in one.summary)
    assert item.code in ("PROTOCOL-FIELD", "PROTOCOL-FRONT-MATTER")
    assert item.span is not None and item.span.line == line
    assert hint is None or (item.hint is not None and hint in item.hint)


def test_a_step_without_prose_or_without_its_schema_is_refused(tmp_path: Path) -> None:
    _, found = load(tmp_path, LAMP.partition("# LAMP")[0])
    assert [item.code for item in found] == ["PROTOCOL-EMPTY"]
    (tmp_path / "protocol" / "schemas").mkdir()
    _, found = load(tmp_path, LAMP)
    assert [item.code for item in found] == ["PROTOCOL-NO-SCHEMA"]


def test_where_a_projects_own_spec_lies() -> None:
    assert str(own_path("step.arm")) == "privileged/arm.md"
    assert str(own_path("serve")) == "serve.md"


def test_the_prompt_of_a_step_speaks_of_its_input_and_of_the_code_beside_it() -> None:
    where = Path("/work/attempt")
    step = shipped_step("arm")
    text = render_prompt(
        Prompt(step.spec, where / "output.json", where / "input.json", where, where / "spec.md", 30, 200.0)
    )
    assert "agent of one privileged step of octoform" in text and ": ARM.\n" in text
    assert "Read first what the step is about: input.json\n" in text
    assert "the server's code, which lies beside it" in text
    assert "which the stage before wrote" not in text
    assert len(text.encode()) < 16 * 1024
