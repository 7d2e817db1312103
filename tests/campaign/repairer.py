"""The agent of WATCH and HEAL in the campaign: reports what a script has, with citations that are in its input.

``python repairer.py SCRIPT``: SCRIPT is a JSON object, ``watch`` and ``heal`` to one behaviour each:
``{"write": TEXT}``, ``{"report": {...}}`` (an error without citations gets the first failure's), ``{"exit": N}``,
``{"shout": HEX}`` and ``{"flood": BYTES}`` on stdout, ``{"touch": [PATHS]}``, ``{"sleep": SECONDS}`` before all of
that, and for HEAL ``{"server": "broken" | "without_tool" | "weaker" | "mended"}``.
"""

import json
import os
import re
import sys
import time
from pathlib import Path
from typing import Any

TOOL = re.compile(r"@mcp\.tool\([^@]*@runtime\.logged\ndef weigh\(\).*?(?=\n\n\n)", re.DOTALL)


def given() -> dict[str, Any]:
    """The stage's task with its input."""
    task: dict[str, Any] = json.loads(Path(os.environ["OCTOFORM_TASK"]).read_text())
    return task


def cited(report: dict[str, Any], known: dict[str, Any]) -> dict[str, Any]:
    """The report with what it was given as its evidence."""
    ids = [each["id"] for each in (*known.get("failures", ()), *known.get("readings", ()))]
    if report.get("stage") == "heal" and not report.get("cites"):
        report["cites"] = list(known.get("error", {}).get("cites", ()))
    for error in report.get("errors", ()):
        if isinstance(error, dict):
            error.setdefault("cites", ids[:1])
    for text in report.get("declarations", ()):
        text.setdefault("cites", ids[:1])
    return report


FAILS = """        return Said(text=grams[runtime.read_text(unit.path("hwmon") / "temp1_input") or "0"])"""
MENDED = """        weight = runtime.read_text(unit.path("hwmon") / "temp1_input")
        if weight is None:
            raise RuntimeError("the sensor gave no reading")
        return Said(text=grams.get(weight, "something"))"""
"""No value is made up for one that was not read: what is refused otherwise (SERVE-DEFAULT-READING)."""


def server(how: str, source: Path, target: Path) -> None:
    """A candidate for HEAL."""
    text = source.read_text()
    if how == "broken":
        text += "\ndef weigh(:\n"
    elif how == "without_tool":
        text = TOOL.sub("", text)
    else:
        text = text.replace(FAILS, MENDED)
        text = text.replace("> HEAVIEST:", "> 2 * HEAVIEST:") if how == "weaker" else text
    target.write_text(text)


def main() -> int:
    script, task = Path(sys.argv[1]), given()
    stage, output = str(task["stage"]), Path(task["output"])
    with script.with_suffix(".log").open("a") as log:
        log.write(json.dumps({"stage": stage, "attempt": task["attempt"], "pid": os.getpid()}) + "\n")
    behaviour = json.loads(script.read_text())[stage]
    time.sleep(behaviour.get("sleep", 0))
    if "shout" in behaviour:
        sys.stdout.buffer.write(bytes.fromhex(behaviour["shout"]) + b"\n")
    if "flood" in behaviour:
        print("x" * behaviour["flood"], flush=True)
    for name in behaviour.get("touch", ()):
        with Path(name).open("a") as file:
            file.write("touched by the agent\n")
    if "write" in behaviour:
        output.write_text(behaviour["write"])
    if "report" in behaviour:
        known = json.loads(Path(task["input"]).read_text())
        output.write_text(json.dumps(cited(behaviour["report"], known)))
        if "server" in behaviour:
            server(behaviour["server"], Path(task["input"]).parent / "server.py", output.parent / "server.py")
    return int(behaviour.get("exit", 0))


if __name__ == "__main__":
    sys.exit(main())
