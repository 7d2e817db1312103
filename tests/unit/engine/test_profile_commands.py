"""``octoform profile new`` and ``check``: a draft that has to be completed, and the reasons of a rule, host by host."""

import json
from collections.abc import Mapping
from pathlib import Path

import pytest
from projects import Project

DEVICE, OTHER = "usb-16c0-05df", "usb-1a86-7523"
ARM = Path(__file__).parents[3] / "profiles" / "so-arm101.md"


def device(name: str, product: str, **more: object) -> dict[str, object]:
    vid, pid = name.split("-")[1:3]
    raw = f"vendor_id: {vid}\nproduct_id: {pid}\nmanufacturer: Lampmaker\nproduct: {product}"
    return {"id": name, "name": product, "vid": vid, "pid": pid, "interface": "usb", "raw_descriptor": raw, **more}


def probed(project: Project, host: str, *devices: Mapping[str, object]) -> None:
    path = project.folder / "state" / host / "probe" / "output.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps({"format": 1, "devices": devices}))


@pytest.fixture
def bench(tmp_path: Path) -> Project:
    """A project that knows three hosts: its own with two devices, one with the arm's own words, a damaged one."""
    project = Project(tmp_path / "project", tmp_path / "outside", harness="builtin")
    project.write()
    (project.folder / "arm.md").write_text(ARM.read_text())
    lamp = device(DEVICE, "Bench Lamp 2", classes=["tty"], drivers=["cdc_acm"])
    probed(project, "bench", lamp, device(OTHER, "USB Serial"), device("usb-1a86-7523-2", "USB Serial", context=True))
    probed(project, "lab", device(OTHER, "LeRobot arm"))
    probed(project, "old")
    return project


def test_a_rule_is_explained_host_by_host_and_part_by_part(bench: Project) -> None:
    done = bench.run("profile", "check", "arm.md", status=0)
    assert "arm.md is sound" in done.out and "host old" not in done.out
    bench_part, _, lab = done.out.partition("host lab")
    assert "host bench: matches 0 of its devices" in bench_part
    assert f"- {OTHER}  USB Serial" in bench_part
    assert "vid_pid: holds, it has 1a86:7523" in bench_part
    assert (
        "text: fails, none of Feetech, STS3215, LeRobot, SO-ARM100, SO-ARM101 is in its text, and there is no answer"
        in bench_part
    )
    assert "2 other devices meet no number and no word" in bench_part and "usb-1a86-7523-2" not in done.out
    assert "matches 1 of its devices" in lab and "text: holds, LeRobot is in its text" in lab


def test_an_answer_of_this_host_counts_and_is_told_apart(bench: Project) -> None:
    bench.manifest["answers"] = f"{{{OTHER}: that is the SO-ARM101}}"
    bench.write()
    done = bench.run("profile", "check", "arm.md", status=0)
    assert "host bench: matches 1 of its devices" in done.out
    assert "text: holds, SO-ARM101 is in the answer about it" in done.out
    document = json.loads(bench.run("profile", "check", "arm.md", "-json", status=0).out)
    (met,) = document["hosts"][0]["devices"]
    assert (met["holds"], met["answered"]) == (True, True)
    assert met["rule"]["parts"][1]["answered"] == ["SO-ARM101"]


def test_product_and_rig_are_shown_apart(bench: Project) -> None:
    rig = "rig:\n  facts: [Joint 1 is broken.]\n  limits: [{parameter: position, maximum: 3000}]\n"
    path = bench.folder / "arm.md"
    path.write_text(path.read_text().replace("\n---\n\n#", f"\n{rig}---\n\n#", 1))
    product, _, own = bench.run("profile", "check", "arm.md", status=0).out.partition("  This rig alone\n")
    assert "at most 4095" in product and "3000" not in product and "Joint 1" not in product
    assert own.startswith("    Joint 1 is broken.\n    position at most 3000\n")
    found = json.loads(bench.run("profile", "check", "arm.md", "-json", status=0).out)["profile"]
    assert found["limits"][0]["maximum"] == 4095 and 3000 not in [limit["maximum"] for limit in found["limits"]]
    rig_alone = {"facts": ["Joint 1 is broken."], "limits": [{"parameter": "position", "maximum": 3000}]}
    assert found["rig"] == {**rig_alone, "disabled": {}, "units": {}}


def test_the_bus_is_shown_as_it_is_on_the_rig(bench: Project) -> None:
    rig = "rig:\n  disabled: {shoulder_pan: its motor is broken}\n  units: {wrist_flex: 5, wrist_roll: 4}\n"
    path = bench.folder / "arm.md"
    path.write_text(path.read_text().replace("\n---\n\n#", f"\n{rig}---\n\n#", 1))
    shown = bench.run("profile", "check", "arm.md", status=0).out
    assert "arm_set_torque (joint, on: boolean)  actuate, set_torque" in shown
    assert "speed: integer 50..1500 raw/s = 400)  actuate, pose" in shown
    assert "elbow_flex 3, wrist_flex 5, wrist_roll 4, gripper 6" in shown
    assert "refused from 69 Cel on until it is below 60 Cel" in shown
    assert "shoulder_pan is disabled: its motor is broken." in shown.partition("This rig alone")[2]
    found = json.loads(bench.run("profile", "check", "arm.md", "-json", status=0).out)["profile"]
    assert found["grammar"]["registers"]["disabled"] == {"shoulder_pan": "its motor is broken"}
    assert found["rig"]["units"] == {"wrist_flex": 5, "wrist_roll": 4}


def test_a_draft_is_refused_until_a_person_has_completed_it(bench: Project) -> None:
    done = bench.run("profile", "new", DEVICE, status=0)
    path = bench.folder / "profiles" / "lampmaker-bench-lamp-2.md"
    assert "add to octopus.yaml: profiles: [profiles/lampmaker-bench-lamp-2.md]" in done.out
    draft = path.read_text()
    assert '- vid_pid: "16c0:05df"\n    - text: ["Bench Lamp 2"]\n    - class: ["tty"]' in draft
    assert bench.run("profile", "check", str(path), status=1).err.count("error[PROFILE-FIELD]") == 2
    path.write_text(draft.replace('about: ""', "about: the lamp") + "\nIt shines.\n")
    assert "host bench: matches 1 of its devices" in bench.run("profile", "check", str(path), status=0).out
    again = bench.run("profile", "new", DEVICE, "-json", status=1)
    assert "PROFILE-EXISTS" in again.text and "It shines." in path.read_text()


@pytest.mark.parametrize(("host", "name", "hint"), [("bench", "usb-16c0-05de", DEVICE), ("desk", DEVICE, "apply")])
def test_a_draft_needs_a_device_of_this_host(bench: Project, host: str, name: str, hint: str) -> None:
    bench.host = host
    bench.write()
    done = bench.run("profile", "new", name, status=1)
    assert "PROFILE-NO-DEVICE" in done.err and hint in done.err
    assert not (bench.folder / "profiles").exists()


@pytest.mark.parametrize(
    ("answer", "product"),
    [
        ("that is the Heron pump P-20 on the left of the bench", "Heron pump P-20"),
        ("Heron pump", "Heron pump"),
        ("it's my camera rail, second one", "camera rail"),
    ],
)
def test_a_draft_takes_the_owners_answer_before_the_words_of_the_bridge(
    bench: Project, answer: str, product: str
) -> None:
    bench.manifest["answers"] = f"{{{OTHER}: {json.dumps(answer)}}}"
    bench.write()
    done = bench.run("profile", "new", OTHER, "-json", status=0)
    (path,) = (bench.folder / "profiles").glob("*.md")
    assert path.name in done.text
    draft = path.read_text()
    assert f"product: {json.dumps(product)}" in draft and f"- text: {json.dumps([product])}" in draft
    assert "USB Serial" not in draft
    path.write_text(draft.replace('about: ""', "about: the pump") + "\nIt pumps.\n")
    assert "host bench: matches 1 of its devices" in bench.run("profile", "check", str(path), status=0).out


def test_the_words_of_a_bridge_are_no_evidence(bench: Project) -> None:
    bench.run("profile", "new", OTHER, status=0)
    (path,) = (bench.folder / "profiles").glob("*.md")
    assert "USB Serial" not in path.read_text()
    assert "'text' needs a string or a list of strings" in bench.run("profile", "check", str(path), status=1).err


def test_a_device_without_words_leaves_the_words_open(bench: Project) -> None:
    silent = device("usb-16c0-0001", "x") | {"raw_descriptor": "vendor_id: 16c0", "id": "usb-16c0-0001"}
    probed(bench, "desk", silent)
    bench.host = "desk"
    bench.write()
    bench.run("profile", "new", "usb-16c0-0001", status=0)
    done = bench.run("profile", "check", "profiles/usb-16c0-0001.md", status=1)
    assert "'text' needs a string or a list of strings" in done.err


def test_no_mark_of_probe_gets_into_a_draft(bench: Project) -> None:
    marked = device(DEVICE, "Heron\\x1b[31m Pump Station <serial> [cut]")
    probed(bench, "desk", marked)
    bench.host = "desk"
    bench.write()
    bench.run("profile", "new", DEVICE, status=0)
    draft = (bench.folder / "profiles" / "lampmaker-pump-station.md").read_text()
    assert 'product: "Lampmaker Pump Station"' in draft and '- text: ["Pump Station"]' in draft
