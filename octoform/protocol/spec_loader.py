"""Read the specs of stages and background tasks, a project's own laid over the shipped ones. (Heavy: reads YAML.)

The front matter states what a stage reads and writes. octoform's order of stages is fixed, so these fields must agree
with it: a field that could be changed without effect would mislead its reader.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from os.path import lexists
from pathlib import Path
from typing import Any

from octoform import frontmatter
from octoform.base import digest, durations
from octoform.diagnostics import Diagnostic, did_you_mean, error, warning
from octoform.frontmatter import Document
from octoform.patterns import regex
from octoform.protocol.model import (
    DUTIES,
    FRAME,
    PROOFS,
    SCHEMAS,
    STAGES,
    STEP,
    Proof,
    Spec,
    Step,
    schema_dir,
    spec_paths,
)

__all__ = ["load", "schema_dir", "spec_paths"]

NAMES = (*STAGES, *DUTIES)
PRODUCES = {stage: f"{stage}/output.json" for stage in NAMES} | {"serve": "serve/server.py"}
CONSUMES = {
    **{after: [PRODUCES[before]] for before, after in pairwise(STAGES)},
    STAGES[0]: [],
    "watch": ["identify/output.json", "interface/output.json"],
    "heal": ["watch/output.json", "serve/server.py"],
}
"""What a background task reads is put together for it (`input.json`); these are the artifacts that it is made from."""
FIELDS = ("stage", "consumes", "produces", "schema", "budget")
NOT_SPECS = ("README.md",)
_DURATION = regex(r"[1-9][0-9]{0,5}(?:s|m|h)")


def load(folder: Path | None) -> tuple[dict[str, Spec], list[Diagnostic]]:
    """All specs by stage and background task, and every problem of all of them; one with a problem is absent.

    ``folder`` is a project's ``protocol/`` (it need not exist), None for the shipped specs alone.
    """
    if folder is not None and lexists(folder) and not folder.is_dir():
        hint = "put a folder of specs in its place, or remove it to use the shipped ones"
        return {}, [error("PROTOCOL-FRONT-MATTER", "this is no folder of specs", path=str(folder), hint=hint)]
    specs: dict[str, Spec] = {}
    found = _strangers(folder)
    for stage, path in spec_paths(folder).items():
        spec, problems = load_one(stage, path, schema_dir(folder))
        found += problems
        if spec is not None:
            specs[stage] = spec
    return specs, found


def load_one(stage: str, path: Path, schemas: Path) -> tuple[Spec | None, list[Diagnostic]]:
    """The spec of one stage or background task from any file, or what is wrong with it."""
    document, found = frontmatter.read(path, "PROTOCOL-FRONT-MATTER")
    if document is None:
        return None, found
    found = _check_fields(stage, document)
    schema = schemas / f"{stage}.v1.schema.json" if stage != "serve" else None
    if schema is not None and not schema.is_file():
        hint = f"copy it there, or remove the folder {SCHEMAS} to use the shipped ones"
        found.append(error("PROTOCOL-NO-SCHEMA", f"the schema of {stage} is missing", path=str(schema), hint=hint))
    if not document.body.strip():
        found.append(document.problem("PROTOCOL-EMPTY", f"the spec of {stage} is empty"))
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
    found = [*_unknown(document, "spec", FIELDS), *_unfit(document, f"stage {stage}", expected)]
    budget = document.fields.get("budget")
    if budget is not None and not (isinstance(budget, str) and _DURATION.fullmatch(budget)):
        summary = "the field 'budget' is no time for one attempt"
        found.append(document.problem("PROTOCOL-FIELD", summary, ("budget",), "write it like 200s or 5m"))
    return found


def _unknown(document: Document, kind: str, known: Sequence[str]) -> list[Diagnostic]:
    """Fields that nothing of this kind has; one that changed nothing would mislead its reader."""
    found = []
    for name in document.fields:
        if name not in known:
            near = did_you_mean(name, known)
            hint = f"did you mean {near!r}?" if near else f"a {kind} has the fields {', '.join(known)}"
            found.append(document.problem("PROTOCOL-FIELD", f"{name!r} is no field of a {kind}", (name,), hint))
    return found


def _unfit(document: Document, whose: str, expected: Mapping[str, object]) -> list[Diagnostic]:
    """Fields that are missing or have another value than the only one that fits."""
    found = []
    for name, value in expected.items():
        if name not in document.fields:
            summary = f"the field {name!r} is missing"
        elif document.fields[name] != value:
            summary = f"the field {name!r} does not fit the {whose}"
        else:
            continue
        found.append(document.problem("PROTOCOL-FIELD", summary, (name,), f"write {name}: {_display(value)}"))
    return found


def _display(value: object) -> str:
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


# Read the specs of privileged steps, a project's own laid over the shipped ones. (Heavy: reads YAML.)
#
# A step is a file: its name gives the name that the manifest switches on, its front matter names the device that it
# runs and what proves that it worked. So a step is added without a line of code.

STEP_CONSUMES = ("identify/output.json", "interface/output.json", "serve/server.py")
STEP_SCHEMA = f"{SCHEMAS}/step.v1.schema.json"
STEP_FIELDS = ("step", "about", "profile", "proof", "consumes", "produces", "schema", "budget")
PROOF_FIELDS = ("kind", "minimum", "unit", "settle")
PROFILE_NAME = regex(r"[a-z0-9]+(?:-[a-z0-9]+)*")
MAX_ABOUT = 200
MAX_UNIT = 20
MAX_SETTLE = 60
SETTLE = 2.0


def load_step(name: str, path: Path, folder: Path | None) -> tuple[Step | None, list[Diagnostic]]:
    """The step of a file, or everything that is wrong with it; ``folder`` is a project's ``protocol/``."""
    document, found = frontmatter.read(path, "PROTOCOL-FRONT-MATTER")
    if document is None:
        return None, found
    fields = document.fields
    found = [*_unknown(document, "step", STEP_FIELDS), *_fixed(name, document), *_words(document), *_proof(document)]
    schema = schema_dir(folder) / Path(STEP_SCHEMA).name
    if not schema.is_file():
        hint = f"copy it there, or remove the folder {SCHEMAS} to use the shipped ones"
        found.append(error("PROTOCOL-NO-SCHEMA", "the schema of the steps is missing", path=str(schema), hint=hint))
    if not document.body.strip():
        found.append(document.problem("PROTOCOL-EMPTY", f"the spec of the step {name} is empty"))
    if found:
        return None, found
    spec = Spec(
        stage=f"{STEP}{name}",
        path=path,
        text=document.text,
        body=document.body,
        digest=digest.of_bytes(document.text.encode("utf-8")),
        consumes=tuple(fields["consumes"]),
        produces=fields["produces"],
        schema=schema,
        budget=fields.get("budget"),
    )
    return Step(name, fields["about"].strip(), fields["profile"], _read_proof(fields["proof"]), spec), []


def _read_proof(given: Any) -> Proof:
    settle = durations.seconds(given["settle"]) if "settle" in given else None
    return Proof(
        kind=given["kind"],
        minimum=float(given.get("minimum", 0)),
        unit=given.get("unit", ""),
        settle=float(settle) if settle is not None else SETTLE,
    )


def _fixed(name: str, document: Document) -> list[Diagnostic]:
    """Fields with one value that they can have: octoform's own order of work decides it."""
    expected = {
        "step": name,
        "consumes": list(STEP_CONSUMES),
        "produces": f"steps/{name}/output.json",
        "schema": STEP_SCHEMA,
    }
    return _unfit(document, f"step {name}", expected)


def _words(document: Document) -> list[Diagnostic]:
    """The sentence about it, the profile that it needs, the time for one attempt."""
    fields, found = document.fields, []
    about = fields.get("about")
    if not (isinstance(about, str) and 0 < len(about.strip()) <= MAX_ABOUT and "\n" not in about.strip()):
        hint = "write about: test that each joint of the arm moves"
        found.append(document.problem("PROTOCOL-FIELD", "the field 'about' is no short sentence", ("about",), hint))
    profile = fields.get("profile", "")
    if profile is not None and not (isinstance(profile, str) and PROFILE_NAME.fullmatch(profile)):
        hint = "name the profile without which the step may not run, or write profile: null"
        found.append(document.problem("PROTOCOL-FIELD", "the field 'profile' names none", ("profile",), hint))
    budget = fields.get("budget")
    if budget is not None and not (isinstance(budget, str) and durations.seconds(budget)):
        summary = "the field 'budget' is no time for one attempt"
        found.append(document.problem("PROTOCOL-FIELD", summary, ("budget",), durations.HINT))
    return found


def _proof(document: Document) -> list[Diagnostic]:
    """The problems of the proof; a step without a proof is invalid."""
    proof = document.fields.get("proof")
    if not isinstance(proof, dict):
        hint = "write proof: {kind: reading, minimum: 50, unit: raw, settle: 2s}"
        return [document.problem("PROTOCOL-FIELD", "the field 'proof' is missing or no mapping", ("proof",), hint)]
    found = [
        document.problem("PROTOCOL-FIELD", f"{name!r} is no field of a hardware test", ("proof", name), _near(name))
        for name in proof
        if name not in PROOF_FIELDS
    ]
    return found + [
        document.problem("PROTOCOL-FIELD", summary, ("proof", field), hint)
        for field, summary, hint in _proof_problems(proof)
    ]


def _near(name: str) -> str:
    near = did_you_mean(name, PROOF_FIELDS)
    return f"did you mean {near!r}?" if near else f"a hardware test has the fields {', '.join(PROOF_FIELDS)}"


def _proof_problems(proof: dict[str, Any]) -> list[tuple[str, str, str]]:
    """(field, summary, hint) of each wrong field of a proof."""
    found = []
    kind, minimum, settle = proof.get("kind"), proof.get("minimum"), proof.get("settle", "2s")
    if kind not in PROOFS:
        found.append(("kind", "the field 'kind' is no kind of hardware test", f"the kinds are {', '.join(PROOFS)}"))
    number = isinstance(minimum, int | float) and not isinstance(minimum, bool)
    if kind == FRAME and minimum is not None:
        found.append(("minimum", "a hardware test of the kind frame has no 'minimum'", "remove it: nothing moves"))
    if kind != FRAME and not (number and 0 < minimum < float("inf")):  # type: ignore[operator]
        hint = "write the least difference that counts as a movement, such as minimum: 50"
        found.append(("minimum", "the field 'minimum' is no number above 0", hint))
    if not isinstance(proof.get("unit", ""), str) or len(proof.get("unit", "")) > MAX_UNIT:
        found.append(("unit", "the field 'unit' is no short word", "write it like unit: raw"))
    length = durations.seconds(settle) if isinstance(settle, str) else None
    if length is None or not 0 < length <= MAX_SETTLE:
        hint = f"{durations.HINT}; at most {MAX_SETTLE}s are waited for a movement"
        found.append(("settle", "the field 'settle' is no time that a movement may take", hint))
    return found
