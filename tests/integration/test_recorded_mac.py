"""A recorded Mac through the command line: onboarded without a tool, and nothing claimed that is not known."""

import json
from collections.abc import Callable
from pathlib import Path

from projects import Project


def test_a_recorded_mac_is_onboarded_and_where_its_devices_are_is_not_known(
    tmp_path: Path, planted: Callable[..., Path]
) -> None:
    project = Project(tmp_path / "project", tmp_path / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(planted("macos-studio"))
    project.apply("-target", "interface", status=0)
    probed = json.loads((project.state / "probe/output.json").read_text())
    assert (probed["platform"]["os"], probed["platform"]["verified"]) == ("macos", "recorded-only")
    assert json.loads((project.state / "interface/output.json").read_text())["tools"] == []
    rows = json.loads(project.run("devices", "--json", status=0).out)["devices"]
    assert {row["now"] for row in rows} == {None} and "usb-1d9c-0c14" in {row["id"] for row in rows}
    planned = project.run("plan", "-target", "interface").out
    assert "No changes." in planned, planned
