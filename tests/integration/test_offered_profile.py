"""A simulated arm whose profile comes with octoform: each screen offers it with its line, and that line is enough."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from projects import Project

from octoform.simulation.rig import Rig, load

pytestmark = pytest.mark.dear

ARM = "usb-1a86-55d3"
UNMATCHED = "PROFILE-UNMATCHED"
LINE = "write `profiles: [so-arm101]` in octopus.yaml to use it"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Iterator[Project]:
    folder = tmp_path_factory.mktemp("arm")
    description = load("reference")
    description["devices"] = {"arm": description["devices"]["arm"]}
    rig = Rig(description, folder / "tree")
    rig.start()
    project = Project(folder / "project", folder / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(folder / "tree")
    project.share_environments(environments)
    yield project
    project.run("stop")
    rig.stop()


def test_every_screen_offers_it_until_the_manifest_names_it(
    project: Project, tmp_path: Path, packaged: Callable[..., Path]
) -> None:
    project.write()
    applied = project.run("apply", "-auto-approve")
    assert applied.text.count(LINE) == 1, applied.text
    asked = (project.attempts("identify")[-1] / "prompt.md").read_text()
    assert "# Profiles that are not chosen\n" in asked and f"\n{ARM}: so-arm101\n" in asked
    for command in (["plan"], ["devices"]):
        assert project.run(*command).text.count(LINE) == 1, command
    assert [item["line"] for item in json.loads(project.run("devices", "--json").out)["offers"]] == [LINE]
    text = project.run("coverage").out
    assert "".join(LINE.split()) in "".join(text.split()) and "no library or system interface reaches it" not in text
    (arm,) = [item for item in json.loads(project.run("coverage", "--json").out)["devices"] if item["id"] == ARM]
    assert (arm["offer"], arm["reason"]) == (f"so-arm101: {LINE}", "profile_offered")
    project.run("coverage", "-html", str(tmp_path / "page.html"), status=0)
    assert LINE in (tmp_path / "page.html").read_text()

    project.manifest["profiles"] = "[so-arm101, camera-rail]"
    (project.local / "environments").unlink()  # an apply would drop what its server does not need
    project.share_environments(packaged("feetech-servo-sdk"))
    project.write()
    assert project.run("apply", "-auto-approve", status=0).text.count(UNMATCHED) == 1
    assert "# Profiles that are not chosen" not in (project.attempts("identify")[-1] / "prompt.md").read_text()
    deploy = (project.attempts("deploy")[-1] / "prompt.md").read_text()
    assert "Its library: feetech-servo-sdk, imported as scservo_sdk." in deploy and "arm_move_joint" not in deploy
    for screen in ("plan", "status", "coverage"):
        assert project.run(screen).text.count(UNMATCHED) == 1, screen
    (warning,) = json.loads(project.run("status", "-json").out)["warnings"]
    assert "camera-rail" in warning["summary"] and "the number 2341:804f" in warning["detail"]
    for command in (["plan"], ["devices"], ["coverage"], ["coverage", "--json"]):
        assert LINE not in project.run(*command).text, command
    (arm,) = [item for item in json.loads(project.run("coverage", "--json").out)["devices"] if item["id"] == ARM]
    assert "arm_move_joint" in arm["tools"] and arm["offer"] is None
