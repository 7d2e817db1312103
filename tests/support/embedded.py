"""The embedded agent's stages one after the other, without octoform around them: what is written of a planted host."""

import json
from pathlib import Path
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts.host_identity import pseudonymise

KEY = bytes(range(32))


def committed(root: Path) -> dict[str, Any]:
    """What PROBE of the host below ``root`` leaves in git."""
    return pseudonymise(probe_root(root), KEY)


def after_probe(probe: dict[str, Any], root: Path) -> dict[str, str]:
    """The outputs of IDENTIFY, INTERFACE and SERVE, as texts."""
    annotated = identify(probe, IdDatabases(root))
    tools = declare(annotated, 30)
    return {"identify": _text(annotated), "interface": _text(tools), "serve": render(tools)}


def write_state(folder: Path, root: Path) -> None:
    """All of it below a folder, as a state has it."""
    probe = committed(root)
    for stage, text in {"probe": _text(probe), **after_probe(probe, root)}.items():
        path = folder / stage / ("server.py" if stage == "serve" else "output.json")
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")


def _text(value: dict[str, Any]) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False) + "\n"
