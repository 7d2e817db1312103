"""A scripted agent: does at once what a plan file says, whatever the stage. Used through the `command` harness.

``python agent.py SCRIPT``: SCRIPT is a JSON object, stage name to a list of behaviours, one for each attempt (the last
one repeats). A behaviour is ``good`` (write the good artifact beside this file), or an object:

    {"write": TEXT}          write this text as the output        {"copy": FILE}      write that file's content
    {"exit": N}              leave with this status               {"mutate": [...]}   the good JSON with changes
    {"sleep": SECONDS}       wait                                 {"say": TEXT}       print on stdout
    {"link": TARGET}         make the output a symbolic link      {"touch": [PATHS]}  write into other files
    {"grandchild": SECONDS}  leave a process in a session of its own, ignoring SIGTERM

Every call is one line in SCRIPT.log, so that a test can count them.
"""

import importlib.metadata
import json
import os
import subprocess
import sys
import time
from pathlib import Path

GOOD = Path(__file__).parent / "good"
NAMES = {"serve": "server.py"}
SLEEPER = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('up', flush=True); time.sleep({})"


def good(stage: str) -> str:
    text = (GOOD / (NAMES.get(stage) or f"{stage}.json")).read_text()
    if stage == "deploy":  # the exact versions that are here, so that they can be had without a network
        for name, version in (("fastmcp", "4.1"), ("pydantic", "2.12")):
            text = text.replace(
                f'"name": "{name}", "version": "{version}"', f'"name": "{name}", "version": "{found(name)}"'
            )
    return text


def found(name: str) -> str:
    return importlib.metadata.version(name)


def mutate(stage: str, changes: list[list[object]]) -> str:
    """Each change is [path, value]; a value of "__drop__" removes."""
    document = json.loads(good(stage))
    for path, value in changes:
        place = document
        *parents, last = path
        for step in parents:
            place = place[step]
        if value == "__drop__":
            del place[last]
        elif isinstance(place, list) and last == len(place):
            place.append(value)
        else:
            place[last] = value
    return json.dumps(document)


def leave_grandchild(seconds: float) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", SLEEPER.format(seconds)], start_new_session=True, stdout=subprocess.PIPE, text=True
    )
    process.stdout.readline()
    Path("grandchild.pid").write_text(str(process.pid))


def act(behaviour: dict[str, object], stage: str, output: Path) -> None:
    if "say" in behaviour:
        print(behaviour["say"], flush=True)
    if "grandchild" in behaviour:
        leave_grandchild(behaviour["grandchild"])
    for name in behaviour.get("touch", []):
        with Path(name).open("a") as file:
            file.write("touched by the agent\n")
    if "link" in behaviour:
        output.symlink_to(behaviour["link"])
    elif "mutate" in behaviour:
        output.write_text(mutate(stage, behaviour["mutate"]))
    elif "copy" in behaviour:
        output.write_bytes(Path(behaviour["copy"]).read_bytes())
    elif "write" in behaviour:
        output.write_text(behaviour["write"])
    elif not {"exit", "sleep"} & set(behaviour):
        output.write_text(good(stage))
    time.sleep(behaviour.get("sleep", 0))
    sys.exit(behaviour.get("exit", 0))


def main() -> None:
    script = Path(sys.argv[1])
    task = json.loads(Path(os.environ["OCTOFORM_TASK"]).read_text())
    with script.with_suffix(".log").open("a") as log:
        log.write(json.dumps({"stage": task["stage"], "attempt": task["attempt"], "pid": os.getpid()}) + "\n")
    behaviours = json.loads(script.read_text()).get(task["stage"], ["good"])
    behaviour = behaviours[min(task["attempt"], len(behaviours)) - 1]
    act({} if behaviour == "good" else behaviour, task["stage"], Path(task["output"]))


if __name__ == "__main__":
    main()
