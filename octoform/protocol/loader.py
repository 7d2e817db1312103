"""Read the specs of stages and duties, a project's own laid over the shipped ones. (Heavy: reads YAML.)

The front matter says what a stage reads and writes. octoform's order of stages is fixed, so these fields must agree
with it: a field that could be changed without effect would mislead whoever reads it.
"""

import re
from itertools import pairwise
from pathlib import Path

from octoform import digest, frontmatter
from octoform.diagnostics import Diagnostic, did_you_mean, error, warning
from octoform.frontmatter import Document
from octoform.protocol.model import DUTIES, STAGES, Spec
from octoform.protocol.paths import SCHEMAS, schema_dir, spec_paths

__all__ = ["load", "schema_dir", "spec_paths"]

NAMES = (*STAGES, *DUTIES)
PRODUCES = {stage: f"{stage}/output.json" for stage in NAMES} | {"serve": "serve/server.py"}
CONSUMES = {
    **{after: [PRODUCES[before]] for before, after in pairwise(STAGES)},
    STAGES[0]: [],
    "watch": ["identify/output.json", "interface/output.json"],
    "heal": ["watch/output.json", "serve/server.py"],
}
"""What a duty reads is put together for it (`input.json`); these are the artifacts that it is made from."""
FIELDS = ("stage", "consumes", "produces", "schema", "budget")
NOT_SPECS = ("README.md",)
_DURATION = re.compile(r"[1-9][0-9]{0,5}(?:s|m|h)")


def load(folder: Path | None) -> tuple[dict[str, Spec], list[Diagnostic]]:
    """All specs by stage and duty, and every problem of all of them; one with a problem is absent.

    ``folder`` is a project's ``protocol/`` (it need not exist), None for the shipped specs alone.
    """
    specs: dict[str, Spec] = {}
    found = _strangers(folder)
    for stage, path in spec_paths(folder).items():
        spec, problems = load_one(stage, path, schema_dir(folder))
        found += problems
        if spec is not None:
            specs[stage] = spec
    return specs, found


def load_one(stage: str, path: Path, schemas: Path) -> tuple[Spec | None, list[Diagnostic]]:
    """The spec of one stage or duty from any file, or what is wrong with it."""
    document, found = frontmatter.read(path, "PROTOCOL-FRONT-MATTER")
    if document is None:
        return None, found
    found = _check_fields(stage, document)
    schema = schemas / f"{stage}.v1.schema.json" if stage != "serve" else None
    if schema is not None and not schema.is_file():
        hint = f"copy it there, or remove the folder {SCHEMAS} to use the shipped ones"
        found.append(error("PROTOCOL-NO-SCHEMA", f"the schema of {stage} is missing", path=str(schema), hint=hint))
    if not document.body.strip():
        found.append(document.problem("PROTOCOL-EMPTY", f"the spec of {stage} says nothing"))
    if found:
        return None, found
    budget = document.fields.get("budget")
    spec = Spec(
        stage=stage,
        path=path,
        text=document.text,
        body=document.body,
        digest=digest.of_bytes(document.text.encode("utf-8")),
        consumes=tuple(document.fields["consumes"]),
        produces=document.fields["produces"],
        schema=schema,
        budget=budget if isinstance(budget, str) else None,
    )
    return spec, []


def _check_fields(stage: str, document: Document) -> list[Diagnostic]:
    expected = {
        "stage": stage,
        "consumes": CONSUMES[stage],
        "produces": PRODUCES[stage],
        "schema": f"{SCHEMAS}/{stage}.v1.schema.json" if stage != "serve" else None,
    }
    found = []
    for name in document.fields:
        if name not in FIELDS:
            near = did_you_mean(name, FIELDS)
            hint = f"did you mean {near!r}?" if near else f"a spec has the fields {', '.join(FIELDS)}"
            found.append(document.problem("PROTOCOL-FIELD", f"{name!r} is no field of a spec", (name,), hint))
    for name, value in expected.items():
        if name not in document.fields:
            summary = f"the field {name!r} is missing"
        elif document.fields[name] != value:
            summary = f"the field {name!r} does not fit the stage {stage}"
        else:
            continue
        found.append(document.problem("PROTOCOL-FIELD", summary, (name,), f"write {name}: {_shown(value)}"))
    budget = document.fields.get("budget")
    if budget is not None and not (isinstance(budget, str) and _DURATION.fullmatch(budget)):
        summary = "the field 'budget' is no time for one attempt"
        found.append(document.problem("PROTOCOL-FIELD", summary, ("budget",), "write it like 200s or 5m"))
    return found


def _shown(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(value)}]"
    return "null" if value is None else str(value)


def _strangers(folder: Path | None) -> list[Diagnostic]:
    """Markdown beside the specs that no stage reads: most likely a misspelt name."""
    if folder is None or not folder.is_dir():
        return []
    found = []
    for path in sorted(folder.glob("*.md")):
        if path.stem not in NAMES and path.name not in NOT_SPECS:
            near = did_you_mean(path.stem, NAMES)
            hint = f"did you mean {near}.md?" if near else f"the specs are {', '.join(NAMES)}"
            summary = f"no stage is called {path.stem!r}, so nothing reads this file"
            found.append(warning("PROTOCOL-UNUSED", summary, path=str(path), hint=hint))
    return found
