"""The values of a loaded manifest: defaults, stages laid over general settings, digests, references."""

import errno
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from octoform.harness.adapters import command as command_harness
from octoform.harness.port import Task, TaskLimits
from octoform.manifest import model, problem_list
from octoform.manifest.loader import load
from octoform.manifest.model import KEEPERS, Budget, Daemon, HarnessSpec, Manifest, Notify
from octoform.manifest.references import contains, malformed, names, resolve, resolve_argument


def loaded(folder: Path, text: str, **environ: str) -> Manifest:
    (folder / "octopus.yaml").write_text(text, "utf-8")
    manifest, found = load(folder / "octopus.yaml", environ)
    assert manifest is not None, found
    return manifest


def test_defaults(tmp_path: Path) -> None:
    manifest = loaded(tmp_path, "version: 1\n")
    assert manifest.host == "local"
    assert manifest.scope == "local"
    assert manifest.profiles == ()
    assert manifest.path == tmp_path / "octopus.yaml"
    assert manifest.project == tmp_path
    assert not manifest.lifecycle.prevent_destroy
    assert not manifest.git.commit
    for stage in model.STAGES:
        assert manifest.harness_for(stage) == HarnessSpec("builtin")
        assert manifest.model_for(stage) is None
        assert manifest.budget_for(stage) == Budget(3, 200.0, 600.0, 30)
    assert manifest.settings_for("interface") == {"tools": 30}
    assert manifest.settings_for("probe") == {}


def test_a_stage_differs_only_where_it_says_so(tmp_path: Path) -> None:
    manifest = loaded(
        tmp_path,
        "version: 1\n"
        "harness: {name: command, command: [agent, '{task}'], env: [KEY], prompt: file}\n"
        "model: vendor/general\n"
        "budget: {attempts: 2, attempt_timeout: 1m40s, stage_timeout: 1h, tools: 12}\n"
        "stages:\n"
        "  probe: {harness: builtin}\n"
        "  serve: {model: vendor/special, budget: {attempts: 5, attempt_timeout: 300s}}\n",
        KEY="x",
    )
    general = HarnessSpec("command", ("agent", "{task}"), ("KEY",), "file")
    assert manifest.harness_for("identify") == general
    assert manifest.harness_for("probe") == HarnessSpec("builtin")
    assert manifest.model_for("probe") is None
    assert manifest.model_for("identify") == "vendor/general"
    assert manifest.model_for("serve") == "vendor/special"
    assert manifest.budget_for("identify") == Budget(2, 100.0, 3600.0, 12)
    assert manifest.budget_for("serve") == Budget(5, 300.0, 3600.0, 12)
    assert manifest.variables == ("KEY",)


def test_the_daemon_has_defaults_that_move_no_digest(tmp_path: Path) -> None:
    plain = loaded(tmp_path, "version: 1\n")
    assert plain.daemon == Daemon()
    assert [plain.harness_for(name).name for name in KEEPERS] == ["builtin", "builtin"]
    assert plain.digest == loaded(tmp_path, "version: 1\ndaemon: {interval: 300s, notify: {}}\n").digest
    assert plain.digest == loaded(tmp_path, "version: 1\nstages: {watch: {}}\n").digest
    assert plain.digest != loaded(tmp_path, "version: 1\ndaemon: {apply: ask}\n").digest


def test_what_the_daemon_is_told(tmp_path: Path) -> None:
    manifest = loaded(
        tmp_path,
        "version: 1\n"
        "daemon:\n"
        "  {interval: 10s, heal_attempts: 5, apply: ask, calls_per_hour: 2, claim_expiry: 1h30m, metrics: out/a.prom,\n"
        "   notify: {command: [./tell], webhook: '${URL}', desktop: true}}\n",
        URL="https://alerts.example.org/value-of-url",
    )
    found = Notify(("./tell",), "${URL}", desktop=True)
    assert manifest.daemon == Daemon(10, 5, "ask", 2, None, 5400, found, tmp_path / "out" / "a.prom")
    assert manifest.variables == ("URL",)
    assert "value-of-url" not in repr(manifest)


def test_who_keeps_watch(tmp_path: Path) -> None:
    """As the general agent does, unless set otherwise; a recording knows no later troubles."""
    text = "version: 1\nharness: pi\nmodel: openai/a\nstages: {heal: {model: ollama/b, budget: {attempts: 1}}}\n"
    manifest = loaded(tmp_path, text, OPENAI_API_KEY="x")
    assert [(manifest.harness_for(name).name, manifest.model_for(name)) for name in KEEPERS] == [
        ("pi", "openai/a"),
        ("pi", "ollama/b"),
    ]
    assert [manifest.budget_for(name).attempts for name in KEEPERS] == [3, 1]
    (tmp_path / "taken").mkdir()
    manifest = loaded(tmp_path, "version: 1\nharness: {name: replay, recording: taken}\n")
    assert [manifest.harness_for(name).name for name in ("serve", *KEEPERS)] == ["replay", "builtin", "builtin"]


def test_digest_is_of_the_meaning(tmp_path: Path) -> None:
    first = loaded(tmp_path, "version: 1\nhost: a\nbudget: {attempts: 3}\n").digest
    assert loaded(tmp_path, "# words\nbudget:\n  attempts: 3   # default\nhost: 'a'\nversion: 1\n").digest == first
    assert loaded(tmp_path, "version: 1\nhost: a\n").digest == first
    assert loaded(tmp_path, "version: 1\nhost: b\n").digest != first
    assert loaded(tmp_path, "version: 1\nhost: a\nbudget: {attempts: 4}\n").digest != first


def test_no_value_of_a_variable_is_kept(tmp_path: Path) -> None:
    text = "version: 1\nmodel: ${M}\nharness: {name: command, command: [agent, '--key=${K}'], env: [E]}\n"
    values = {"M": "value-of-m", "K": "value-of-k", "E": "value-of-e"}
    manifest = loaded(tmp_path, text, **values)
    assert not any(value in repr(manifest) for value in values.values())
    assert manifest.variables == ("E", "K", "M")
    assert manifest.digest == loaded(tmp_path, text, M="other", K="other", E="other").digest
    assert [resolve(item, values) for item in manifest.harness_for("probe").command] == ["agent", "--key=value-of-k"]


def test_profiles_are_absolute_and_in_order(tmp_path: Path) -> None:
    (tmp_path / "profiles").mkdir()
    for name in ("b.md", "a.md"):
        (tmp_path / "profiles" / name).write_text("# x\n")
    manifest = loaded(tmp_path, "version: 1\nprofiles: [profiles/b.md, ./profiles/a.md]\n")
    assert manifest.profiles == (tmp_path / "profiles" / "b.md", tmp_path / "profiles" / "a.md")


@pytest.mark.parametrize("lead", ["", "folder/"])
def test_a_profile_that_links_outside_is_refused(tmp_path: Path, lead: str) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "x.md").write_text("# x\n")
    project = tmp_path / "project"
    project.mkdir()
    (project / "folder").symlink_to(outside)
    (project / "x.md").symlink_to(outside / "x.md")
    (project / "octopus.yaml").write_text(f"version: 1\nprofiles: [{lead}x.md]\n")
    manifest, found = load(project / "octopus.yaml", {})
    assert manifest is None
    assert [item.code for item in found] == ["MANIFEST-PROFILE-OUTSIDE"]


def test_a_project_behind_a_link_may_have_profiles(tmp_path: Path) -> None:
    project = tmp_path / "project"
    project.mkdir()
    (project / "x.md").write_text("# x\n")
    (project / "octopus.yaml").write_text("version: 1\nprofiles: [x.md]\n")
    (tmp_path / "link").symlink_to(project)
    manifest, found = load(tmp_path / "link" / "octopus.yaml", {})
    assert manifest is not None
    assert found == []


def test_a_missing_manifest_says_what_to_do(tmp_path: Path) -> None:
    _, found = load(tmp_path / "octopus.yaml", {})
    assert [(item.code, item.hint) for item in found] == [
        ("MANIFEST-NOT-FOUND", "`octoform init` writes an octopus.yaml for this host")
    ]
    (tmp_path / "octopus.yml").write_text("version: 1\n")
    _, found = load(tmp_path / "octopus.yaml", {})
    assert found[0].hint == "octopus.yml is here: rename it to octopus.yaml"


def test_what_is_no_file_is_refused_without_waiting(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "loop").symlink_to("loop")
    for name, words in (
        ("folder", "it is no regular file"),
        ("fifo", "it is no regular file"),
        ("loop", "it is a link to itself"),
    ):
        _, found = load(tmp_path / name, {})
        assert [(item.code, item.summary) for item in found] == [
            ("MANIFEST-UNREADABLE", f"the manifest cannot be read: {words}")
        ]
        assert found[0].hint is not None and f"ls -l {name}" in found[0].hint


def test_who_may_not_read_it_is_sent_to_its_owner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(path: Path, *_: object, **__: object) -> bytes:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(problem_list, "head", closed)
    _, (found,) = load(tmp_path / "octopus.yaml", {})
    assert found.hint is not None and "ask its owner" in found.hint and "replace" not in found.hint


def test_references() -> None:
    assert names("a${B}c${D_1}$${E}") == ("B", "D_1")
    assert contains("x${B}")
    assert not contains("$${B} $B {B}")
    assert malformed("${} ${1} ${A $${B} ${C}") == ("${}", "${1}", "${A $$")
    assert resolve("a${B}$${B}${", {"B": "${C}"}) == "a${C}${B}${"
    with pytest.raises(KeyError):
        resolve("${B}", {})


def test_a_value_is_never_taken_for_a_placeholder(tmp_path: Path) -> None:
    environ = {"A": "{task}{{", "B": "plain"}
    task = {"task": "/t"}
    for text, filled in [
        ("${A}{task}", "{task}{{/t"),
        ("$${task}", "${task}"),
        ("$${HOME", "${HOME"),
        ("{{task}}-${B}", "{task}-plain"),
    ]:
        assert command_harness.fill(resolve_argument(text, environ), task) == filled


def test_the_harness_fills_every_placeholder(tmp_path: Path) -> None:
    paths: dict[str, Any] = {name: tmp_path / name for name in ("prompt", "output", "log", "document")}
    paths["prompt"].write_text("do it")
    task = Task("probe", 1, tmp_path, **paths, model="vendor/m", environment={}, limits=TaskLimits(1.0))
    harness = command_harness.CommandHarness(tuple(f"{{{name}}}" for name in model.PLACEHOLDERS), (), "argument")
    assert dict(zip(model.PLACEHOLDERS, harness.arguments(task), strict=True)) == {
        **{"prompt_file": str(paths["prompt"]), "task": str(paths["document"]), "output": str(paths["output"])},
        **{"workdir": str(tmp_path), "model": "vendor/m", "stage": "probe", "prompt": "do it"},
    }


def test_every_code_has_a_page_and_every_page_a_code() -> None:
    package = Path(model.__file__).parent
    used = set(re.findall(r'"(MANIFEST-[A-Z-]+)"', "".join(file.read_text("utf-8") for file in package.rglob("*.py"))))
    pages = package.parent / "diagnostics" / "pages"
    assert used == {page.stem for page in pages.glob("MANIFEST-*.md")}
    for code in used:
        assert (pages / f"{code}.md").read_text("utf-8").startswith(f"# {code}: ")


@pytest.mark.parametrize("module", ["model", "references", "starter", "model_url", "credentials"])
def test_light_modules_stay_light(module: str) -> None:
    code = (
        f"import sys, octoform.manifest.{module}; "
        "print([name for name in ('pydantic', 'ruamel.yaml', 'rich', 'jsonschema') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


COMPILED = """
import sys
from pathlib import Path
from octoform.manifest.loader import load
from octoform.manifest.schema.document import Table

assert load(Path(sys.argv[1]), {})[0] is not None
tables = [Table]
for table in tables:
    tables += table.__subclasses__()
print(*(table.__name__ for table in tables if table.__pydantic_complete__))
"""


def test_no_table_of_a_manifest_is_compiled_but_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "octopus.yaml"
    path.write_text("version: 1\nharness: {name: builtin}\npolicy: {rules: [{tools: [x], decision: deny}]}\n")
    ended = subprocess.run([sys.executable, "-c", COMPILED, str(path)], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["Document"]
