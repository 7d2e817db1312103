"""``octoform devices``: exit codes, and a host whose endpoint was never made."""

import json
import sys
from pathlib import Path

from projects import Project

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from hosts.plant import plant


def test_without_an_accepted_artifact_it_says_what_makes_one(tmp_path: Path) -> None:
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.write()
    done = project.run("devices", status=1)
    assert "error[ARTIFACT-MISSING]: probe has no accepted output yet" in done.err
    assert json.loads(project.run("devices", "--json", status=1).out.splitlines()[0])


def test_it_needs_no_endpoint_and_shows_what_is_plugged_in_elsewhere(tmp_path: Path) -> None:
    project = Project(tmp_path / "project", tmp_path / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(plant("bench", tmp_path / "first"))
    project.apply("-target", "identify", status=0)
    project.environ["OCTOFORM_SYSROOT"] = str(
        plant("bench", tmp_path / "second", {"1-10": "1-12", "ttyACM0": "ttyACM4"})
    )
    listed = json.loads(project.run("devices", "--json", status=0).out)
    stepper = next(row for row in listed["devices"] if row["id"] == "usb-1d9c-5e12")
    assert stepper["now"]["port"] == "1-12"
    assert stepper["now"]["nodes"] == ["/dev/ttyACM4"]
    assert stepper["now"]["strength"] == "strong"
    assert "HW-12-0042" not in json.dumps(listed)
    assert "serial number: HW-12-0042, committed as redacted-" in project.run("devices", "-v", status=0).out
    output = project.state / "identify" / "output.json"
    accepted = output.read_text()
    output.write_text(accepted.replace('"evidence": [', '"evidence": 5, "was": [', 1))
    assert "error[ARTIFACT-MISSING]: identify has an output that is damaged" in project.run("devices", status=1).err
    output.write_text(accepted)
    (project.local / "instances.json").unlink()
    assert "does not know which units it has" in project.run("devices", status=0).out
