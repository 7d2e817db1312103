"""A tool with only a new name is reported as renamed: when INTERFACE is made again, and in the plan after it."""

import json

from projects import Project

NEW = {"mutate": [[["tools", 0, "name"], "look_around"]]}


def test_a_rename_is_told_by_apply_and_by_the_plan_after_it(project: Project) -> None:
    project.script = {"interface": ["good", NEW]}
    first = project.apply("-target", "interface", status=0)
    (tool,) = json.loads((project.state / "interface" / "output.json").read_text())["tools"]
    assert " was " not in first.out
    served = {tool["name"]: {"effect": tool["effect"], "buses": tool["devices"]}}
    (project.local / "endpoint").mkdir(parents=True)
    policy = json.dumps({"format": 1, "mode": "enforce", "tools": served})
    (project.local / "endpoint" / "policy.json").write_text(policy)
    assert "look_around" not in project.run("plan").out

    project.script = {"interface": [NEW]}
    again = project.apply("-target", "interface", "-replace", "interface", status=0)
    assert f"1 tool, look_around was {tool['name']}" in again.out
    assert f"~ look_around, renamed from {tool['name']}" in project.run("plan", status=0).out
    streamed = [event["change"] for event in project.run("plan", "--json").events() if event["type"] == "known_change"]
    change = {"kind": "tool", "name": "look_around", "action": "update", "text": f"renamed from {tool['name']}"}
    assert change in streamed
