"""``octoform simulate RIG``: a rig in the foreground until Ctrl-C. A program of its own, that uses no other package."""

import argparse
import json
import os
import select
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from octoform.simulation.rig import Rig, RigInvalid, load, names
from octoform.simulation.rig_commands import HELP, CommandRefused, changed, describe, obey

MEMORY = Path("/dev/shm")
"""Where the folder is made when it can be: the camera's file is replaced several times a second."""
_LOOK = 0.5
_ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def main(words: Sequence[str] | None = None) -> int:
    """Run a rig. 0 when it was ended, from the keyboard or by a signal; 1 when it could not begin."""
    given = _parse(words)
    try:
        description = load(given.rig)
        for text in given.set:
            description = _set(description, text)
        with _folder(given.folder) as folder, _signals():
            _run(Rig(description, folder), as_json=given.json)
    except (RigInvalid, CommandRefused, OSError) as problem:
        print(f"octoform simulate: {problem}", file=sys.stderr)
        return 1
    return 0


class _Given:
    """What was typed."""

    rig: str
    folder: str | None
    set: list[str]
    json: bool


def _parse(words: Sequence[str] | None) -> _Given:
    parser = argparse.ArgumentParser(prog="octoform simulate", description=__doc__, allow_abbrev=False)
    parser.add_argument("rig", help=f"a rig by its name ({', '.join(names())}) or the path of its .yaml file")
    parser.add_argument("-folder", "--folder", metavar="DIR", help="make the tree in DIR, which is empty or not there")
    parser.add_argument(
        "-set", "--set", metavar="NAME.KEY=VALUE", action="append", default=[], help="another value in the description"
    )
    parser.add_argument("-json", "--json", action="store_true", help="one JSON object a line")
    return parser.parse_args(words, namespace=_Given())


def _set(description: Mapping[str, Any], text: str) -> dict[str, Any]:
    target, equals, value = text.partition("=")
    name, dot, key = target.partition(".")
    if not (equals and dot and name and key):
        raise CommandRefused(f"-set takes NAME.KEY=VALUE, such as arm.anonymous=true, and not {text}")
    try:
        return changed(description, name, key, json.loads(value))
    except json.JSONDecodeError:
        return changed(description, name, key, value)


@contextmanager
def _folder(given: str | None) -> Iterator[Path]:
    """An empty folder, of which nothing is left; one that was there before stays, empty again."""
    if given is None:
        memory = MEMORY if os.access(MEMORY, os.W_OK) else None
        folder, before = Path(tempfile.mkdtemp(prefix="octoform-rig-", dir=memory)), False
    else:
        folder = Path(given).absolute()
        before = folder.exists()
        if before and (not folder.is_dir() or any(folder.iterdir())):
            raise CommandRefused(f"{folder} is not an empty folder")
        folder.mkdir(parents=True, exist_ok=True)
    try:
        yield folder
    finally:
        if before:
            for path in folder.iterdir():
                shutil.rmtree(path)
        else:
            shutil.rmtree(folder)


@contextmanager
def _signals() -> Iterator[None]:
    """Every way to end the program is the same as Ctrl-C."""
    for number in _ENDS:
        if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _interrupted)
    yield


def _interrupted(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def _run(rig: Rig, *, as_json: bool) -> None:
    try:
        rig.start()
        _print(_started(rig), as_json=as_json)
        _listen(rig, as_json=as_json)
    except KeyboardInterrupt:
        with suppress(OSError):  # a closed terminal has no reader
            _print({"event": "stopped"}, as_json=as_json)
    finally:
        for number in _ENDS:
            signal.signal(number, signal.SIG_IGN)  # cleaning up takes a moment and is not to be interrupted
        rig.stop()


def _listen(rig: Rig, *, as_json: bool) -> None:
    """Obey the lines of standard input; when it ends, go on without."""
    listening, text = [0] if sys.stdin is not None else [], b""
    while True:
        if not select.select(listening, [], [], _LOOK)[0]:
            continue
        data = os.read(0, 4096)
        if not data:
            listening = []
        *lines, text = (text + data).split(b"\n")
        for line in lines:
            _print(_done(rig, line.decode("utf-8", "backslashreplace")), as_json=as_json)


def _done(rig: Rig, line: str) -> dict[str, Any]:
    try:
        return obey(rig, line)
    except CommandRefused as refused:
        return {"event": "refused", "reason": str(refused)}


def _started(rig: Rig) -> dict[str, Any]:
    about = rig.description.get("about", "")
    return {"event": "started", "about": about, "sysroot": str(rig.folder), "devices": describe(rig)}


def _print(event: Mapping[str, Any], *, as_json: bool) -> None:
    print(json.dumps(event) if as_json else _describe(event), flush=True)


def _describe(event: Mapping[str, Any]) -> str:
    kind = event["event"]
    if kind == "started":
        places = [
            f"  {row['name']:10}{row.get('node', 'unplugged'):10}{row.get('port', '')}" for row in event["devices"]
        ]
        use = [
            "In another terminal, in the folder of octopus.yaml:",
            f"  export OCTOFORM_SYSROOT={event['sysroot']}",
            "  octoform apply",
            "Lines that can be typed here:",
            *(f"  {line}" for line in HELP.splitlines()),
            "Ctrl-C ends it and leaves nothing.",
        ]
        return "\n".join([f"Simulated: {event['about']}", *places, *use])
    if kind == "state":
        return "\n".join(json.dumps(row) for device in event["devices"] for row in _rows(device))
    if kind == "refused":
        return str(event["reason"])
    if kind == "stopped":
        return "Stopped; nothing is left."
    return f"{event['device']}: {event.get('fault', kind) or 'whole again'}"


def _rows(device: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """A device in one line, and one more for each of its servos."""
    return [{key: value for key, value in device.items() if key != "servos"}, *device.get("servos", [])]


if __name__ == "__main__":
    sys.exit(main())
