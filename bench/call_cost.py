"""A call of a tool and the list of tools: what each costs a person or a script. (python bench/call_cost.py)

The embedded agent onboards this machine first; a read tool that can be called without a choice is called. What the
endpoint's process spends on it is not counted, nor what apply spends.
"""

import json
import subprocess
import sys
from pathlib import Path

from measuring import OCTOFORM, PYTHON, Command, Row, environment, imported, in_turns, report, scratch
from subjects import embedded, inside

ROUNDS = 15
BOUND = 0.35
JUDGE = "jsonschema"
"""What a call with arguments imports: they are judged by the tool's own schema before they reach a device."""


def commands(folder: Path) -> tuple[list[str], list[str]]:
    """A call without arguments, and one with an argument where there is a tool that has one."""
    told = subprocess.run(
        [OCTOFORM, "tools", "-json"], cwd=folder, env=environment(), capture_output=True, text=True, check=True
    )
    free = [
        tool
        for tool in json.loads(told.stdout)["tools"]
        if tool["effect"] == "read" and not tool["input_schema"].get("required")
    ]
    if not free:
        raise SystemExit("this machine has no tool that can be called without a choice")
    for tool in free:
        for name, given in tool["input_schema"].get("properties", {}).items():
            if isinstance(given.get("default"), str | int):
                call = ["call", tool["name"]]
                return call, [*call, "-arg", f"{name}={given['default']}"]
    return ["call", free[0]["name"]], []


def heavy(folder: Path, plain: list[str], argued: list[str]) -> list[str]:
    """Sentences about heavy libraries that are imported without need; empty when all is well."""
    found = {"tools": imported(["tools"], folder), "call": imported(plain, folder)}
    if argued:
        found["call -arg"] = [name for name in imported(argued, folder) if name != JUDGE]
    return [f"octoform {title} imports {', '.join(names)}" for title, names in found.items() if names]


def main() -> int:
    """Measure, print, and say whether the bound holds."""
    with scratch() as folder:
        made = embedded(folder)
        inside(made, "apply", "-auto-approve")
        try:
            plain, argued = commands(made)
            measured = [Command("octoform call, no arguments", [OCTOFORM, *plain], made)]
            measured += [Command("octoform call, one argument", [OCTOFORM, *argued], made)] if argued else []
            measured.append(Command("octoform tools", [OCTOFORM, "tools"], made))
            bare = Command("python -c pass", [PYTHON, "-c", "pass"], made)
            found = in_turns([*measured, bare], ROUNDS)
            said = heavy(made, plain, argued)
        finally:
            subprocess.run([OCTOFORM, "stop"], cwd=made, env=environment(), stdout=subprocess.DEVNULL, check=False)
    rows = [Row(item.title, found[item.title], bound=BOUND) for item in measured]
    rows.append(Row(bare.title, found[bare.title], note="what the interpreter itself takes"))
    told = said or ["no heavy library is imported but the judge of arguments, where there are some"]
    status = report("call_cost: median CPU of rounds in turns, ratio to a call without arguments", rows, rows[0], told)
    return 1 if said else status


if __name__ == "__main__":
    sys.exit(main())
