"""A scripted agent: carries out a plan file at once, whatever the stage. Used through the `command` harness.

``python agent.py SCRIPT``: SCRIPT is a JSON object, stage name to a list of behaviours, one for each attempt (the last
one repeats). A behaviour is ``good`` (write the good artifact beside this file), or an object:

    {"write": TEXT}          write this text as the output        {"copy": FILE}      write that file's content
    {"exit": N}              leave with this status               {"mutate": [...]}   the good JSON with changes
    {"sleep": SECONDS}       wait                                 {"say": TEXT}       print on stdout
    {"link": TARGET}         make the output a symbolic link      {"touch": [PATHS]}  write into other files
    {"grandchild": SECONDS}  leave a process in a session of its own, ignoring SIGTERM
    {"children": N}          leave N processes behind             {"bytes": HEX}      write these bytes
    {"sparse": SIZE}         write a file of that size with a hole {"shout": HEX}      print these bytes
    {"echo": NAME}           print the value of a variable        {"flood": SIZE}      print one line of that many bytes
    {"ballast": PATH}        fill the disk before the output is written, {"fill": PATH} after it
    {"remove": true}         remove the attempt's whole folder
    {"replace_spec": [KIND, TARGET]}  put a pipe, a folder or a link to TARGET in the place of the spec's copy
    {"leak": NAME}           the good JSON with the value in it; with "escaped": true spelt in \\uXXXX
    {"edit_spec": TEXT}      add a line to the own copy of the spec, before anything else is done
    {"shell": TEXT}          run this in a shell, in the attempt's folder
    {"new_spec": TEXT}       make this the whole copy of the spec
    {"needs_in_spec": TEXT}  the good artifact if the own copy of the spec holds the text, else none
    {"report": OBJECT}       write this as JSON
    {"rewrite": [[OLD, NEW]]}  change the server.py in its folder
    {"name_all": TEXT}       IDENTIFY: every device of the input by that name, on its own name as evidence

Every call is one line in SCRIPT.log, so that a test can count them.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

TYPE_CHECKING = False  # not that of `typing`, which takes a tenth of what a run does
if TYPE_CHECKING:
    from typing import Any

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
        others = [f'{{"module": "{name}", "provided_by": "python"}},' for name in standard() if f'"{name}"' not in text]
        text = text.replace('"imports": [', '"imports": [' + " ".join(others))
    return text


def standard() -> list[str]:
    """The modules of Python that the server in the input imports."""
    document = os.environ.get("OCTOFORM_TASK")
    server = Path(json.loads(Path(document).read_text())["input"]) if document else None
    if server is None or not server.is_file():
        return []
    words = [
        line.split()[1:2] for line in server.read_text().splitlines() if line.lstrip().startswith(("import ", "from "))
    ]
    names = {word.rstrip(",").partition(".")[0] for found in words for word in found}
    return sorted(names & sys.stdlib_module_names - {"__future__"})


def found(name: str) -> str:
    import importlib.metadata  # loaded by the one stage that needs it: it takes as long as all the rest

    return importlib.metadata.version(name)


def mutate(stage: str, changes: list[list[Any]]) -> str:
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
    import subprocess

    process = subprocess.Popen(
        [sys.executable, "-c", SLEEPER.format(seconds)], start_new_session=True, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.readline()
    Path("grandchild.pid").write_text(str(process.pid))


def leak(stage: str, behaviour: dict[str, Any]) -> str:
    """The good output with the value of a variable in the text of its first device."""
    value = os.environ[behaviour["leak"]]
    place = ["devices", 0, "identified_as" if stage == "identify" else "raw_descriptor"]
    text = mutate(stage, [[place, f"sensor {value}"]])
    escaped = "".join(f"\\u{ord(sign):04x}" for sign in value)
    return text.replace(json.dumps(value)[1:-1], escaped) if behaviour.get("escaped") else text


def fill_disk(path: Path) -> None:
    with path.open("ab", buffering=0) as file:
        for size in (4096, 1):
            try:
                while file.write(b"x" * size):
                    pass
            except OSError:
                continue


def speak(behaviour: dict[str, Any]) -> None:
    if "say" in behaviour:
        print(behaviour["say"], flush=True)
    if "echo" in behaviour:
        print(os.environ[behaviour["echo"]], flush=True)
        print(os.environ[behaviour["echo"]], file=sys.stderr, flush=True)
    if "flood" in behaviour:
        print("x" * behaviour["flood"], flush=True)
    if "shout" in behaviour:
        sys.stdout.buffer.write(bytes.fromhex(behaviour["shout"]) + b"\n")
        sys.stdout.buffer.flush()


def leave(behaviour: dict[str, Any]) -> None:
    if "children" in behaviour:
        leave_children(behaviour["children"])
    if "replace_spec" in behaviour:
        replace_spec(*behaviour["replace_spec"])
    if "grandchild" in behaviour:
        leave_grandchild(behaviour["grandchild"])


def replace_spec(kind: str, target: str) -> None:
    copy = Path("spec.md")
    copy.unlink()
    made: dict[str, Callable[[], object]] = {
        "pipe": lambda: os.mkfifo(copy),
        "folder": copy.mkdir,
        "link": lambda: copy.symlink_to(target),
    }
    made[kind]()


def name_all(name: str, output: Path) -> None:
    task = json.loads(Path(os.environ["OCTOFORM_TASK"]).read_text())
    devices = json.loads(Path(task["input"]).read_text())["devices"]
    answers = [
        {
            "id": device["id"],
            "identified_as": name,
            "category": "infrastructure",
            "confidence": 0.4,
            "method": "descriptor_strings",
            "evidence": [{"quote": device["name"]}],
            "capabilities": [],
        }
        for device in devices
    ]
    output.write_text(json.dumps({"format": 1, "devices": answers, "left_out": []}))


def leave_children(count: int) -> None:
    import subprocess

    pids = [subprocess.Popen([sys.executable, "-c", "import time; time.sleep(300)"]).pid for _ in range(count)]
    Path("children.json").write_text(json.dumps(pids))


def remove(_: object, stage: str, output: Path) -> None:
    import shutil

    shutil.rmtree(output.parent)


def write_sparse(size: int, stage: str, output: Path) -> None:
    with output.open("wb") as file:
        file.truncate(size)


def write_if_spec_holds(text: str, stage: str, output: Path) -> None:
    if text in Path("spec.md").read_text():
        output.write_text(good(stage))


# What may stand in the place of the good output; the first that a behaviour names is done.
OUTPUTS: dict[str, Callable[[Any, str, Path], object]] = {
    "remove": remove,
    "sparse": write_sparse,
    "bytes": lambda text, stage, output: output.write_bytes(bytes.fromhex(text)),
    "name_all": lambda name, stage, output: name_all(name, output),
    "needs_in_spec": write_if_spec_holds,
    "link": lambda target, stage, output: output.symlink_to(target),
    "mutate": lambda changes, stage, output: output.write_text(mutate(stage, changes)),
    "copy": lambda source, stage, output: output.write_bytes(Path(source).read_bytes()),
    "write": lambda text, stage, output: output.write_text(text),
    "report": lambda value, stage, output: output.write_text(json.dumps(value)),
}


def write_output(behaviour: dict[str, Any], stage: str, output: Path) -> None:
    chosen = next((name for name in OUTPUTS if name in behaviour), None)
    if "leak" in behaviour:
        output.write_text(leak(stage, behaviour))
    elif chosen is not None:
        OUTPUTS[chosen](behaviour[chosen], stage, output)
    elif not {"exit", "sleep"} & set(behaviour):
        output.write_text(good(stage))


def edit_spec(behaviour: dict[str, Any]) -> None:
    spec = Path("spec.md")
    if "edit_spec" in behaviour:
        spec.chmod(0o644)
        spec.write_text(spec.read_text() + behaviour["edit_spec"] + "\n")
    if "new_spec" in behaviour:
        spec.write_text(behaviour["new_spec"])


def rewrite(changes: list[list[str]]) -> None:
    server = Path("server.py")
    for old, new in changes:
        text = server.read_text()
        assert old in text, old
        server.write_text(text.replace(old, new))


def act(behaviour: dict[str, Any], stage: str, output: Path) -> None:
    speak(behaviour)
    leave(behaviour)
    if "ballast" in behaviour:
        fill_disk(Path(behaviour["ballast"]))
    for name in behaviour.get("touch", []):
        with Path(name).open("a") as file:
            file.write("touched by the agent\n")
    if "shell" in behaviour:
        import subprocess

        subprocess.run(["/bin/sh", "-ec", behaviour["shell"]], check=True)
    edit_spec(behaviour)
    rewrite(behaviour.get("rewrite", []))
    write_output(behaviour, stage, output)
    if "fill" in behaviour:
        fill_disk(Path(behaviour["fill"]))
    time.sleep(behaviour.get("sleep", 0))
    sys.exit(behaviour.get("exit", 0))


def name_of(task: dict[str, Any]) -> str:
    """``STAGE:told`` is a stage whose output a later one found at fault."""
    is_known = "it was found at fault when it was used" in Path("prompt.md").read_text()
    return f"{task['stage']}:told" if is_known else str(task["stage"])


def main() -> None:
    script = Path(sys.argv[1])
    task = json.loads(Path(os.environ["OCTOFORM_TASK"]).read_text())
    name, attempt = name_of(task), task["attempt"]
    with script.with_suffix(".log").open("a+") as log:
        log.seek(0)
        before = [json.loads(line) for line in log]
        log.write(json.dumps({"stage": task["stage"], "attempt": attempt, "name": name, "pid": os.getpid()}) + "\n")
    if name != task["stage"]:
        attempt = 1 + sum(each["name"] == name for each in before)
    behaviours = json.loads(script.read_text()).get(name, ["good"])
    behaviour = behaviours[min(attempt, len(behaviours)) - 1]
    act({} if behaviour == "good" else behaviour, task["stage"], Path(task["output"]))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # what is loaded need not be taken apart
