"""DEPLOY of an agent that gets it wrong, and of a host on which one package cannot be had."""

import importlib.metadata
import json
import sys
import tarfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from bench_host import written
from cases import for_each
from held import Change, Output, both, refusals
from projects import Project
from server_edits import all_of, body, swap

pytestmark = pytest.mark.dear

GOOD = Path(__file__).parents[1] / "agent" / "good"


def puts(path: str, value: Any) -> Change:
    """Set or append what a dotted path names."""

    def change(document: Output) -> None:
        place: Any = document
        *parents, last = path.split(".")
        for part in parents:
            place = place[int(part) if part.isdigit() else part]
        if isinstance(place, list) and int(last) == len(place):
            place.append(value)
        else:
            place[int(last) if last.isdigit() else last] = value

    return change


def asks_for(name: str, why: str | None = None) -> Change:
    """One more requirement, of a package that is here."""
    version = importlib.metadata.version(name)
    return puts("requirements.2", {"name": name, "version": version, "why": why})


# what is wrong -> (change, code, words of the finding)
WRONG: dict[str, tuple[Change, str, str]] = {
    "a version outside of the header's range": (
        puts("requirements.0.version", "4.0.9"),
        "DEPLOY-VERSION-OUTSIDE",
        ">=4.1,<4.2",
    ),
    "two packages for one module": (
        both(asks_for("pydantic-core"), puts("imports.4", {"module": "pydantic", "provided_by": "pydantic-core"})),
        "DEPLOY-PROVIDER-TWICE",
        "leave the other out",
    ),
    "a package without a reason": (asks_for("iniconfig"), "DEPLOY-REQUIREMENT-UNUSED", "why"),
    "a package with a reason that the environment refutes": (
        asks_for("iniconfig", "the tools are faster with it"),
        "DEPLOY-REQUIREMENT-UNUSED",
        "no other package needs it",
    ),
    "an import that the server does not have": (
        both(asks_for("iniconfig"), puts("imports.4", {"module": "iniconfig", "provided_by": "iniconfig"})),
        "DEPLOY-IMPORT-NOT-THERE",
        "does not import",
    ),
    "a module of another package": (
        both(puts("imports.2.provided_by", "fastmcp"), puts("requirements.1.why", "typed results")),
        "DEPLOY-IMPORT-PROVIDER",
        "it comes from 'pydantic'",
    ),
    "an import without a provider": (lambda value: value["imports"].pop(2), "DEPLOY-IMPORT-UNRESOLVED", "pydantic"),
    "a Python that is not the one here": (
        puts("python", f">{'.'.join(map(str, sys.version_info[:3]))}"),
        "DEPLOY-PYTHON-OUTSIDE",
        "which will serve",
    ),
    "the runtime that is not listed": (
        lambda value: value["imports"].pop(3),
        "DEPLOY-IMPORT-UNRESOLVED",
        "`runtime`",
    ),
    "a range for a version": (puts("requirements.0.version", ">=4.1"), "DEPLOY-SCHEMA", "version"),
    "a program that the server does not start": (
        puts("programs", [{"name": "ffmpeg", "package": "ffmpeg"}]),
        "DEPLOY-PROGRAMS-DIFFER",
        "spelt as there",
    ),
    "a package that failed and is required": (
        puts("deps_failed", [{"name": "pydantic", "reason": "no wheel"}]),
        "DEPLOY-FAILED-AND-REQUIRED",
        "pydantic",
    ),
}


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> dict[str, dict[str, str]]:
    """The errors of each wrong artifact, by what is wrong."""
    folder = tmp_path_factory.mktemp("deploy-held")
    deploy = json.loads((GOOD / "deploy.json").read_text())
    for item in deploy["requirements"]:
        item["version"] = importlib.metadata.version(item["name"])
    changes = [*(change for change, _, _ in WRONG.values()), lambda _: None]
    project, errors = refusals(folder, folder / "outside" / "host", "deploy", {}, deploy, changes, packaged())
    project.run("stop", status=0)
    return dict(zip(WRONG, errors, strict=True))


@for_each("case", WRONG, every=3, kind=lambda case: WRONG[case][1])
def test_a_wrong_set_is_refused_with_the_cure(refused: dict[str, dict[str, str]], case: str) -> None:
    _, code, found = WRONG[case]
    assert code in refused[case] and found in refused[case][code], refused[case]


def unbuildable(folder: Path) -> None:
    """A source package whose build always fails."""
    texts = {
        "pyproject.toml": '[build-system]\nrequires = []\nbuild-backend = "broken"\nbackend-path = ["."]\n',
        "broken.py": 'raise SystemExit("no lamp compiler on this machine")\n',
        "PKG-INFO": "Metadata-Version: 2.1\nName: benchlamp\nVersion: 1.0\n",
    }
    folder.mkdir()
    with tarfile.open(folder / "benchlamp-1.0.tar.gz", "w:gz") as archive:
        for name, text in texts.items():
            member = tarfile.TarInfo(f"benchlamp-1.0/{name}")
            member.size = len(text)
            archive.addfile(member, BytesIO(text.encode()))


def test_a_package_that_cannot_be_built_costs_its_tools_alone(tmp_path: Path, packaged: Callable[..., Path]) -> None:
    earlier, good = written(tmp_path / "host")
    unbuildable(tmp_path / "wheels")
    server = all_of(
        swap('"opencv-python-headless>=4.10"', '"opencv-python-headless>=4.10", "benchlamp>=1"'),
        body("read_led", 'import benchlamp\n\nreturn benchlamp.level(runtime.device(device).path("leds"))'),
    )(good)
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.environ |= {"OCTOFORM_SYSROOT": str(tmp_path / "host"), "UV_FIND_LINKS": str(tmp_path / "wheels")}
    project.script = {name: [{"write": json.dumps(output)}] for name, output in earlier.items()}
    project.script["serve"] = [{"write": server}]
    project.manifest = {"stages": "{deploy: {harness: builtin}}"}
    project.share_environments(packaged("opencv-python-headless"))
    done = project.apply(status=0)
    try:
        assert {"SERVE-DEPENDENCY-FAILED", "DEPLOY-DEPENDENCY-FAILED"} <= set(done.codes())
        [failed] = json.loads((project.state / "deploy" / "output.json").read_text())["deps_failed"]
        assert failed["name"] == "benchlamp"
        tools = {tool["name"] for tool in json.loads(project.run("tools", "-json", status=0).out)["tools"]}
        assert "read_temperature" in tools and "read_led" not in tools
        found = project.run("call", "read_led")
        assert found.status != 0 and "benchlamp" in found.text
        assert "No changes." in project.run("plan", "-detailed-exitcode", status=0).out
        assert json.loads(project.run("status", "-json").out)["in_sync"] is True
    finally:
        project.run("stop", status=0)


def test_a_program_that_is_not_here_costs_its_tools_alone(tmp_path: Path, packaged: Callable[..., Path]) -> None:
    earlier, good = written(tmp_path / "host")
    for tool in earlier["interface"]["tools"]:
        if tool["name"] == "read_led":
            tool["description"] += "\n\nThrough: the program benchlamp-level."
    server = all_of(
        swap("import re\n", "import re\nimport subprocess\n"),
        body(
            "read_led",
            'folder = runtime.device(device).path("leds")\n'
            'told = subprocess.run(["benchlamp-level", str(folder)], capture_output=True, timeout=5, check=True)\n'
            "level = int(told.stdout)\n"
            "return Lights(device=device, lights=[Light(name=folder.name, percent=level, level=level, maximum=100)])",
        ),
    )(good)
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.environ |= {"OCTOFORM_SYSROOT": str(tmp_path / "host")}
    (tmp_path / "host/usr/bin").mkdir(parents=True)  # what was recorded of its programs
    project.script = {name: [{"write": json.dumps(output)}] for name, output in earlier.items()}
    project.script["serve"] = [{"write": server}]
    project.manifest = {"stages": "{deploy: {harness: builtin}}"}
    project.share_environments(packaged("opencv-python-headless"))
    done = project.apply(status=0)
    try:
        assert {"INTERFACE-PROGRAM-MISSING", "DEPLOY-PROGRAM-MISSING"} <= set(done.codes())
        tools = {tool["name"] for tool in json.loads(project.run("tools", "-json", status=0).out)["tools"]}
        assert "read_temperature" in tools and "read_led" not in tools
        found = project.run("call", "read_led")
        assert found.status != 0 and "benchlamp-level" in found.text
        assert "benchlamp-level is not on this host" in project.run("doctor").text
        assert "No changes." in project.run("plan", "-detailed-exitcode", status=0).out
    finally:
        project.run("stop", status=0)
