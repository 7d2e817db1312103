"""A person's commands on the endpoint while no process answers: stop, clear, look at the limits, set them back, and
leave a record of what was done beside it.

A program: ``python -I offline.py VERB ENDPOINT-FOLDER [JSON]``; one JSON object on standard output, exit status 0 when
its ``ok`` is true. It needs no serving environment, only the standard library, this folder, and the runtime beside it
or beside the generated server. So it finds the package that it lies in by its place.
"""

import importlib
import importlib.util
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

_PACKAGE = "octoform.server"


def main(arguments: list[str]) -> int:
    """``stop``, ``clear`` ({"by", "reason"}), ``limits``, ``reset`` ({"tool", "by"}; tool null is all), ``note``
    ({"event", ...}: a record with these fields)."""
    verbs = {"stop": _stop, "clear": _clear, "limits": _limits, "reset": _reset, "note": _note}
    if not 2 <= len(arguments) <= 3 or arguments[0] not in verbs:
        print(f"usage: offline.py {'|'.join(verbs)} FOLDER [JSON]", file=sys.stderr)
        return 2
    sys.path.append(str(Path(__file__).resolve().parents[2]))
    folder = Path(arguments[1]).resolve()
    answer = verbs[arguments[0]](folder, json.loads(arguments[2]) if len(arguments) == 3 else {})
    print(json.dumps(answer), flush=True)
    # A device that hangs may hold a thread, which the interpreter would wait for.
    os._exit(0 if answer["ok"] else 1)


def _stop(folder: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    _runtime(folder)
    emergency = _emergency(folder, stopping=True)
    answer: dict[str, Any] = emergency.stop(str(asked.get("by") or "unknown"), str(asked.get("reason") or ""))
    return answer


def _clear(folder: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    answer: dict[str, Any] = _emergency(folder, stopping=False).clear(str(asked.get("by") or "unknown"))
    return answer


def _limits(folder: Path, _: Mapping[str, Any]) -> dict[str, Any]:
    """The counted limits and what is used of them, by tool."""
    policy, limits = _policy("published"), _policy("enforce")
    try:
        read = policy.read(folder / "policy.json")
    except policy.PolicyInvalid as problem:
        return {"ok": False, "problems": [str(problem)]}
    used = limits.Ledger(read, _beside(folder, "run") / "limits.json").used()
    return {"ok": True, "mode": read.mode, "used": used, "problems": []}


def _reset(folder: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    policy, limits = _policy("published"), _policy("enforce")
    tool = asked.get("tool")
    try:
        ledger = limits.Ledger(policy.read(folder / "policy.json"), _beside(folder, "run") / "limits.json")
        log = _log(folder)
        log.write("limits_reset", tool=tool, by=str(asked.get("by") or "unknown"))
        ledger.reset(tool)
    except KeyError:
        return {"ok": False, "problems": [f"{tool} is no tool of this endpoint"], "unknown": True}
    except (OSError, policy.PolicyInvalid) as problem:
        return {"ok": False, "problems": [str(problem)]}
    return {"ok": True, "problems": []}


def _note(folder: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    try:
        _log(folder).write(asked["event"], **{name: value for name, value in asked.items() if name != "event"})
    except OSError as problem:
        return {"ok": False, "problems": [str(problem)]}
    return {"ok": True, "problems": []}


def _emergency(folder: Path, *, stopping: bool) -> Any:
    """All that there is: what cannot be had is reported, and hinders nothing else."""
    latch, policy = _module("latch"), _policy("published")
    problems: list[str] = []
    try:
        log = _log(folder)
    except OSError as problem:
        log = None
        problems.append(f"the audit log has no record of it: {problem}")
    actions: tuple[Any, ...] = ()
    if stopping:
        actions, wrong = policy.stop_actions(folder / "policy.json")
        problems.extend(wrong)
    place = latch.Latch(_beside(folder, "run") / "estop.json")
    unwritten = "the latch could not be written, so nothing is engaged"
    return _module("emergency_stop").Emergency(place, log, actions, tuple(problems), unwritten)


def _runtime(folder: Path) -> None:
    """Make the package ``runtime`` importable, and give it the unit of each device id."""
    document = _connection(folder)
    server = Path(str(document.get("server", {}).get("path", "")))
    for place in (Path(__file__).resolve().parent.parent / "runtime", server.parent / "runtime"):
        if (place / "__init__.py").is_file():
            os.environ.setdefault("OCTOFORM_INSTANCES", str(folder.parent / "instances.json"))
            root = document.get("environment", {}).get("OCTOFORM_SYSROOT")
            if root:
                os.environ.setdefault("OCTOFORM_SYSROOT", str(root))
            _package("runtime", place)
            return


def _connection(folder: Path) -> Mapping[str, Any]:
    try:
        document = _read_json(folder / "connection.json")
    except (OSError, ValueError):  # stopping goes on with what lies in its usual place
        return {}
    return document if isinstance(document, dict) else {}


def _read_json(path: Path) -> Any:
    return importlib.import_module("octoform.base.files").read_json(path)


def _log(folder: Path) -> Any:
    """The audit log; AuditFailed when it cannot be written."""
    audit = _module("audit.audit_log")
    return audit.Audit.open(_beside(folder, "log"), witness=_beside(folder, "run") / audit.SEAL)


def _beside(folder: Path, name: str) -> Path:
    return folder.parent / name


def _policy(name: str) -> Any:
    return importlib.import_module(f"octoform.policy.{name}")


def _module(name: str) -> Any:
    return importlib.import_module(f"{_PACKAGE}.{name}")


def _package(name: str, folder: Path) -> ModuleType:
    """Import the package in ``folder`` as ``name``; RuntimeError when there is none."""
    spec = importlib.util.spec_from_file_location(
        name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if spec is None or spec.loader is None:
        raise RuntimeError(f"{folder} is no package")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
