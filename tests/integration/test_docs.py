"""What the documents say is true: links lead somewhere, commands exist, the README's own commands run as written."""

import json
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import warm
from projects import OCTOFORM, Project

from octoform.cli.dispatch import Line
from octoform.cli.table import COMMANDS, GROUPS, HEADING
from octoform.manifest.loader import parse as parse_manifest

ROOT = Path(__file__).parents[2]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def blocks(path: Path, language: str) -> Iterator[str]:
    for found in FENCE.finditer(path.read_text()):
        if found[1] == language:
            yield found[2]


def commands(path: Path) -> list[list[str]]:
    """Every octoform command line of a document's shell examples, without comments."""
    lines = [line for block in blocks(path, "sh") for line in block.splitlines()]
    return [words[1:] for words in (shlex.split(line, comments=True) for line in lines) if words[:1] == ["octoform"]]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files(path: Path) -> None:
    gone = [target for target in LINK.findall(path.read_text()) if not (path.parent / target).exists()]
    assert gone == []


def test_tests_that_are_named_are_there() -> None:
    named = {name: path.name for path in DOCUMENTS for name in re.findall(r"`(tests/[\w./-]+)`", path.read_text())}
    assert len(named) > 10
    assert {name: where for name, where in named.items() if not (ROOT / name).exists()} == {}


@pytest.mark.parametrize("topic", ["device_moved", "claim", "caps", "perception", "macOS", "WSL2"])
def test_each_divergence_of_the_lifecycle_is_reported_with_what_shows_it(topic: str) -> None:
    _, _, lifecycle = (ROOT / "docs" / "paper.md").read_text().partition("## The lifecycle\n")
    rows = [line.split(" | ") for line in lifecycle.splitlines() if line.startswith("| ") and " | " in line]
    shown = [LINK.findall(row[2]) for row in rows if topic in " ".join(row[:2])]
    assert shown and all(shown), "a row about it leads to the page that describes it"


@pytest.mark.parametrize(
    ("begin", "reported"),
    [
        ("| PROBE is a model's work", ["embedded agent", "unless the manifest names another", "](contracts.md)"]),
        ("The core holds no hardware access, and yet", ["`octoform/runtime`", "imports the runtime", "no product"]),
    ],
)
def test_a_divergence_of_the_architecture_is_reported_with_its_reason(begin: str, reported: list[str]) -> None:
    parts = re.split(r"\n(?=\||\n)", (ROOT / "docs" / "paper.md").read_text())
    [part] = [each for each in parts if each.strip().startswith(begin)]
    assert [each for each in reported if each not in " ".join(part.split())] == []
    named = re.findall(r"`(octoform/[\w/.]+)`", part)
    assert all((ROOT / name).exists() for name in named)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_of_examples_exist(path: Path) -> None:
    for words in commands(path):
        Line(words).arguments()


@pytest.mark.parametrize("group", GROUPS)
def test_every_command_is_documented_in_its_group(group: str) -> None:
    text = (ROOT / "docs" / "commands.md").read_text()
    _, _, below = text.partition(f"\n### {group.capitalize()}\n")
    rows = [line for line in below.partition("\n#")[0].splitlines() if line.startswith("| `")]
    names = [each.name for each in COMMANDS if each.group == group and HEADING not in each.traits]
    assert [
        name for name in names if not any(re.search(rf"`{name}[ `]", row.split(" | ")[0] + " ") for row in rows)
    ] == []


def test_yaml_examples_are_valid_manifests(tmp_path: Path) -> None:
    examples = [block for path in DOCUMENTS for block in blocks(path, "yaml") if "version:" in block]
    assert examples
    for block in examples:
        names = re.findall(r"profiles/[\w.-]+\.md", block)
        for name in names:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text("a profile\n")
        environ = dict.fromkeys(re.findall(r"[A-Z][A-Z0-9_]{3,}", block), "value-of-a-test")
        _, found = parse_manifest(block.encode(), tmp_path / "octopus.yaml", environ)
        assert [item for item in found if item.severity == "error"] == [], block


@pytest.mark.slow
# What they have answers in a planted tree too; the second has nothing.
@pytest.mark.parametrize(("host", "place"), [("server", "clone"), ("empty-vm", "own")])
def test_the_readmes_commands_run_in_their_order_in_a_fresh_clone_and_outside_of_it(
    tmp_path: Path, planted: Callable[..., Path], compiled: Path, host: str, place: str
) -> None:
    """The clone has nothing but its files; in the other folder stands the packages' environment already."""
    tree, folder = planted(host), tmp_path / place
    folder.mkdir()
    if place == "own":
        Project(folder, tmp_path / "outside", host="local").take_environments(compiled)
    for name in ("octopus.yaml", "protocol", "profiles") if place == "clone" else ():
        # What of a clone octoform reads; its state is another host's.
        copied = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copied(ROOT / name, folder / name)
    kept = {name: os.environ[name] for name in ("PATH", "SSL_CERT_FILE", "UV_CONSTRAINT") if name in os.environ}
    environ = {**kept, "HOME": str(tmp_path / "home"), "OCTOFORM_SYSROOT": str(tree)}
    environ["UV_CACHE_DIR"] = os.environ.get("UV_CACHE_DIR", str(Path("~/.cache/uv").expanduser()))
    used = commands(ROOT / "README.md")
    assert [words[0] for words in used] == [
        *("validate", "plan", "apply", "status", "tools", "call", "attempts", "devices", "coverage"),
        *("answer", "clients", "estop", "estop", "audit", "destroy"),
    ]
    fields = {}
    for words in [["init"], *used] if place == "own" else used:
        done = warm.completed(OCTOFORM, words, folder, environ, 120, said="yes\n")
        assert done.returncode == 0, (words, done.stdout, done.stderr)
        assert "error[" not in done.stderr, (words, done.stderr)
        fields[words[0]] = done.stdout
    assert ": in sync, healthy" in fields["status"]
    found = re.findall(r"^  (discovered|identified|unknown|skipped) +(\d+) ", fields["apply"], re.MULTILINE)
    counts = {word: int(number) for word, number in found}
    named = counts["identified"] + counts["unknown"]
    assert counts["discovered"] == named + counts["skipped"], counts
    assert re.findall(r"^skipped \((\d+)\)", fields["coverage"], re.MULTILINE) == [str(counts["skipped"])]
    assert re.search(rf"^{named} devices?,.* {counts['skipped']} skipped;", fields["devices"], re.MULTILINE)
    if host == "empty-vm":
        assert fields["tools"] == fields["call"] and fields["call"].startswith(
            "The endpoint has no tools: nothing here"
        )
    hosts = list((folder / "state").iterdir())
    assert json.loads((hosts[0] / "state.json").read_text())["nodes"] == {}
