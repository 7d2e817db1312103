"""From an accepted value to files: what git keeps, what stays on the machine, and the line a person reads."""

import hmac
import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import octoform
from octoform import events
from octoform.apply.context import Context
from octoform.apply.stage.acceptance import Verdict, digest_of
from octoform.base import files
from octoform.base.files import read
from octoform.contracts.artifact_parser import parse
from octoform.contracts.host_identity import instances, judged, keep_ids, pseudonymise
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex
from octoform.state.artifact_cache import read_instances, write_instances
from octoform.state.files import read_regular, spending, write_atomic
from octoform.state.layout import Layout

KEY_BYTES = 32
MACHINE_ID = Path("/etc/machine-id")
_IS_MACHINE_ID = regex(rb"[0-9a-f]{32}")
RUNTIME = Path(octoform.__file__).parent / "runtime"


def settle(
    context: Context, stage: str, value: Any, diagnostics: list[Diagnostic], extra: Mapping[str, bytes] | None = None
) -> Verdict:
    """The verdict of an accepted value, with its committed files."""
    value = _with_kept_ids(context, value) if stage == "probe" else value
    makers = {"probe": _probe, "serve": _serve}
    files = makers.get(stage, _json)(context, value)
    return Verdict(
        diagnostics=tuple(diagnostics),
        value=value,
        digest=digest_of(context, stage, value),
        files={**files, **(extra or {})},
        found=_SENTENCES[stage](value),
        detail=_COUNTS[stage](value),
    )


def text_of(value: object) -> bytes:
    """Artifacts as they are in git: indented, key order kept, one final line feed."""
    return (json.dumps(value, indent=2, ensure_ascii=False) + "\n").encode()


def remember(context: Context, stage: str, value: Any) -> list[Diagnostic]:
    """Keep on this machine what PROBE saw of it: the instances, and what the kernel announced at that time."""
    if stage != "probe":
        return []
    layout = context.layout
    hardware = text_of({"format": 1, "digest": context.fingerprint, "entries": list(context.hardware)})
    problem = spending(layout, lambda: next(iter(write_instances(layout, instances(value))), None))
    problem = problem or spending(layout, lambda: write_atomic(layout.fingerprint, hardware, 0o600))
    return [problem] if problem else []


def _with_kept_ids(context: Context, value: Any) -> Any:
    """PROBE's value with every unit under the id that it has on this machine; what cannot be determined is stated."""
    value = judged(value)
    ledger, _ = read_instances(context.layout)
    data, _ = read_regular(context.layout.output("probe"))
    before = parse("probe", data, "output.json")[0] if data is not None else None
    if not ledger or not isinstance(before, dict) or not isinstance(before.get("devices"), list):
        return value
    kept = keep_ids(value, pseudonymise(value, _key(context)), before, ledger)
    for notice in kept.notices:
        context.emit(events.Notice("probe", notice))
    return kept.probe


def _probe(context: Context, value: Any) -> dict[str, bytes]:
    return {"output.json": text_of(pseudonymise(value, _key(context)))}


def _key(context: Context) -> bytes:
    return pseudonym_key(context.layout, context.store.snapshot.lineage)


def pseudonym_key(layout: Layout, lineage: str = "") -> bytes:
    """32 secret bytes of this host, made once and never committed: a serial number could be guessed otherwise.

    They follow from the machine's own secret id and the lineage, so that a fresh clone on the same machine goes on with
    the same pseudonyms; where there is no such id they are drawn. OSError when they cannot be kept.
    """
    path = layout.local / "pseudonym.key"
    if path.is_file() and path.stat().st_size == KEY_BYTES:
        return files.read(path, KEY_BYTES)
    machine = machine_id() if lineage else b""
    drawn = hmac.digest(machine, f"octoform pseudonyms {lineage}".encode(), "sha256") if machine else None
    key = drawn or secrets.token_bytes(KEY_BYTES)
    problem = spending(layout, lambda: write_atomic(path, key, 0o600))
    if problem is not None:
        raise OSError(None, problem.summary)
    return key


def machine_id() -> bytes:
    """128 random bits that a machine keeps for itself (machine-id(5) asks to hash them before use); may be empty."""
    try:
        found = MACHINE_ID.read_bytes().strip()
    except OSError:
        return b""
    return found if _IS_MACHINE_ID.fullmatch(found) else b""


def _json(_: Context, value: Any) -> dict[str, bytes]:
    return {"output.json": text_of(value)}


def _serve(_: Context, value: Any) -> dict[str, bytes]:
    return {"server.py": value.encode(), **runtime_files()}


def runtime_files() -> dict[str, bytes]:
    """The standard-library modules that are beside every generated server, by relative name."""
    return {path.relative_to(RUNTIME.parent).as_posix(): read(path) for path in sorted(RUNTIME.rglob("*.py"))}


def counted(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def _unknown(value: Any) -> int:
    return sum(1 for device in value["devices"] if device["category"] == "unknown")


_SENTENCES = {
    "probe": lambda value: (
        f"{counted(len(value['devices']), 'device')} discovered by {counted(len(value['scan_methods']), 'scan')}"
    ),
    "identify": lambda value: (
        f"{len(value['devices']) - _unknown(value)} identified, {_unknown(value)} unknown, "
        f"{len(value['left_out'])} skipped"
    ),
    "interface": lambda value: counted(len(value["tools"]), "tool"),
    "serve": lambda value: f"server.py, {len(value.splitlines())} lines",
    "deploy": lambda value: counted(len(value["requirements"]), "exact requirement"),
}

_COUNTS = {
    "probe": lambda value: {"devices": len(value["devices"])},
    "identify": lambda value: {"annotated": len(value["devices"]), "unknown": _unknown(value)},
    "interface": lambda value: {"tools": len(value["tools"]), "left_out": len(value["left_out"])},
    "serve": lambda value: {"lines": len(value.splitlines())},
    "deploy": lambda value: {"requirements": len(value["requirements"])},
}
