"""Which privileged steps are in force: those of the manifest, from their files, each with the profile that it needs."""

from pathlib import Path

import pytest

from octoform.diagnostics import Diagnostic
from octoform.engine.plan.configuration import Compiled, compile_project, source_files

PROFILE = "---\nname: bench-lamp\nabout: a lamp\nevidence: {text: [Bench Lamp]}\n---\n\nIt dims.\n"
STEP = """---
step: lamp
about: prove that the lamp dims
profile: bench-lamp
proof: {kind: reading, minimum: 5, unit: percent}
consumes: [identify/output.json, interface/output.json, serve/server.py]
produces: steps/lamp/output.json
schema: schemas/step.v1.schema.json
---

Dim it.
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with a profile and a step of its own."""
    for name, text in {"profiles/lamp.md": PROFILE, "protocol/privileged/lamp.md": STEP}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    return tmp_path


def compiled(project: Path, text: str, *, told: bool = True) -> tuple[Compiled | None, list[Diagnostic]]:
    (project / "octopus.yaml").write_text(f"version: 1\n{text}\n")
    return compile_project(project, {}, named=told)


def test_no_step_is_in_force_by_itself(project: Path) -> None:
    made, found = compiled(project, "profiles: [profiles/lamp.md]")
    assert made is not None and found == []
    assert (made.steps, made.graph.names()[-1]) == ({}, "endpoint")


def test_a_step_by_files_alone(project: Path) -> None:
    made, found = compiled(project, "profiles: [profiles/lamp.md]\nprivileged_steps: [perceive, lamp]")
    assert made is not None and found == []
    assert list(made.steps) == ["step.perceive", "step.lamp"]
    assert made.graph.names()[-2:] == ("step.perceive", "step.lamp")
    assert made.specs["step.lamp"] is made.steps["step.lamp"].spec
    assert project / "protocol" / "privileged" / "lamp.md" in source_files(made)
    assert made.layout.output("step.lamp") == project / "state" / "local" / "steps" / "lamp" / "output.json"
    assert made.manifest.budget_for("step.lamp").attempts == 3


def test_without_what_a_person_said_there_are_no_steps(project: Path) -> None:
    made, found = compiled(project, "profiles: [profiles/lamp.md]\nprivileged_steps: [lamp]", told=False)
    assert made is not None and found == []
    assert made.steps == {} and made.manifest.privileged_steps == ()


@pytest.mark.parametrize(
    ("text", "code", "column", "hint"),
    [
        ("privileged_steps: [lmap]", "STEP-UNKNOWN", 20, "did you mean `lamp`?"),
        ("privileged_steps: [zzz]", "STEP-UNKNOWN", 20, "protocol/privileged/zzz.md would add it"),
        ("privileged_steps: [perceive, lamp]", "STEP-WITHOUT-PROFILE", 30, "add it to `profiles`"),
        ("privileged_steps: [README]", "MANIFEST-WRONG-VALUE", 20, "write it as its file is called"),
    ],
)
def test_a_wrong_name_is_told_with_its_place(project: Path, text: str, code: str, column: int, hint: str) -> None:
    (project / "protocol" / "privileged" / "README.md").write_text("about them")
    made, found = compiled(project, text)
    assert made is None
    assert [item.code for item in found] == [code]
    assert found[0].span is not None and (found[0].span.line, found[0].span.column) == (2, column)
    assert found[0].source == text
    assert found[0].hint is not None and hint in found[0].hint


def test_a_step_with_a_problem_is_told_in_its_own_file(project: Path) -> None:
    path = project / "protocol" / "privileged" / "lamp.md"
    path.write_text(STEP.replace("minimum: 5", "minimum: 0"))
    made, found = compiled(project, "profiles: [profiles/lamp.md]\nprivileged_steps: [lamp]")
    assert made is None
    assert [(item.code, item.path) for item in found] == [("PROTOCOL-FIELD", str(path))]
    assert compiled(project, "profiles: [profiles/lamp.md]")[0] is not None
