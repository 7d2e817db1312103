"""The gate: between what an agent left behind and what counts.

exit status, then the file itself (there, no link, bounded), then parse, schema and rules; SERVE is also imported in
an environment of its own declared packages, DEPLOY is started and called. Nothing is taken from the agent's word.
"""

import errno
import stat
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from octoform.apply.context import Context, accepted_before
from octoform.base import files
from octoform.base.id_databases import IdDatabases
from octoform.base.shortage import TEXT, printed
from octoform.contracts.artifact_parser import parse
from octoform.contracts.canonical import output_digest
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.diagnostics import UNTRUSTED_CERTIFICATE, Diagnostic, error, has_errors, is_untrusted_certificate
from octoform.harness.port import ExitReason, Outcome, Task, Usage
from octoform.manifest.profile_paths import shipped
from octoform.profiles import Profile, commands, definition, devices_of, profile_parser
from octoform.protocol.prompt import tail
from octoform.records import dataclass, field, replace
from octoform.state.files import unforeseen_refusal

MAX_BYTES = {"serve": 256 * 1024}
MAX_JSON_BYTES = 8 * 1024 * 1024
LINES_QUOTED = 2
BYTES_QUOTED = 400


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict of the gate: the value and the files to accept, or the reasons to refuse.

    ``files`` are the committed files by name below the stage's folder; ``found`` is one line for a person; ``detail``
    goes into the state. ``rewritten`` is the server that a step has put into the place of the accepted one.
    ``last``: the agent is not asked again, whatever it is that was wrong.
    """

    diagnostics: tuple[Diagnostic, ...]
    value: Any = None
    digest: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    found: str = ""
    detail: Mapping[str, object] = field(default_factory=dict)
    rewritten: str | None = None
    last: bool = False

    @property
    def accepted(self) -> bool:
        """True when nothing but warnings was found."""
        return not has_errors(self.diagnostics)


_ENDINGS: Mapping[ExitReason, tuple[str, str, str]] = {
    ExitReason.TIMEOUT: (
        "APPLY-TIMEOUT",
        "the agent of {stage} did not end within {wall:.0f} s and was stopped",
        "raise budget.attempt_timeout in octopus.yaml if the work needs longer",
    ),
    ExitReason.IDLE: (
        "APPLY-IDLE",
        "the agent of {stage} showed no progress for {idle:.0f} s and was stopped",
        "raise budget.idle_timeout in octopus.yaml if its model thinks longer than that",
    ),
    ExitReason.TURN_LIMIT: (
        "APPLY-TURN-LIMIT",
        "the agent of {stage} went on after {turns} replies of its model and was stopped",
        "raise budget.turns in octopus.yaml if the work needs more; a loop needs another model",
    ),
    ExitReason.BUDGET: (
        "APPLY-COST-LIMIT",
        "the agent of {stage} has cost more than the {usd:.2f} US dollars that were left, and was stopped",
        "raise budget.usd in octopus.yaml, or choose a cheaper model",
    ),
    ExitReason.AUTH: (
        "APPLY-AUTH",
        "{stage}'s agent has no key that the model's provider accepts",
        "check the key's variable and what the key may use; `octoform doctor` tests it",
    ),
    ExitReason.REFUSED: (
        "APPLY-MODEL-REFUSED",
        "the model's provider takes no requests of {stage}'s agent for the model {model}",
        "check the model's name and the account; `octoform doctor` asks which models there are",
    ),
    ExitReason.RATE_LIMIT: (
        "APPLY-RATE-LIMIT",
        "the model's provider limits the requests of {stage}'s agent",
        "wait, or choose another model or provider",
    ),
    ExitReason.UNREACHABLE: (
        "APPLY-MODEL-UNREACHABLE",
        "the model of {stage}'s agent could not be reached or failed to answer",
        "`octoform doctor` tests the model's API; check base_url, the network and the provider",
    ),
}


def ended_well(outcome: Outcome, task: Task) -> list[Diagnostic]:
    """Why the run itself already failed; whatever it wrote then counts for nothing."""
    if outcome.reason is ExitReason.FINISHED:
        return []
    # What a program prints for machines is no quotation; its own closing words are in the detail.
    message = tail(task.log, LINES_QUOTED, BYTES_QUOTED) if outcome.turns is None else ""
    detail = (
        "\n".join(part for part in (outcome.detail, f"its last output: {message}" if message else "") if part) or None
    )
    if outcome.reason is ExitReason.CRASHED and printed(detail or ""):
        # Its own limits are ours, and asking it again would end in the same way.
        return [unforeseen_refusal(BlockingIOError(errno.EAGAIN, TEXT))]
    if outcome.reason in _ENDINGS:
        code, text, hint = _ENDINGS[outcome.reason]
        limits = task.limits
        values = {
            "wall": limits.wall_seconds,
            "idle": limits.idle_seconds,
            "turns": limits.turns,
            "usd": limits.usd,
            "model": task.model,
        }
        hint = UNTRUSTED_CERTIFICATE if is_untrusted_certificate(outcome.detail or "") else hint
        return [error(code, text.format(stage=task.stage, **values), detail=outcome.detail or None, hint=hint)]
    installed = outcome.reason is not ExitReason.NOT_INSTALLED
    text = f"the agent of {task.stage} " + (f"ended with {_status(outcome)}" if installed else "could not be started")
    return [error("APPLY-AGENT-FAILED", text, detail=detail, path=display(task.log))]


def _status(outcome: Outcome) -> str:
    if outcome.exit_status is None:
        return "no exit status"
    return f"signal {-outcome.exit_status}" if outcome.exit_status < 0 else f"exit status {outcome.exit_status}"


def display(path: Path) -> str:
    """A path of an attempt as a person finds it, from the project's folder."""
    parts = path.parts
    return str(Path(*parts[parts.index(".octoform") :])) if ".octoform" in parts else str(path)


def fresh(folder: Path) -> Path:
    """An empty folder of octoform's own, whatever the agent has left in its place: a link would lead out of it."""
    cleared(folder)
    folder.mkdir(mode=0o700)
    return folder


def cleared(path: Path) -> Path:
    """Remove the file, link or folder at a path, if any; returns the path."""
    if path.is_dir() and not path.is_symlink():
        files.remove_tree(path)
    else:
        path.unlink(missing_ok=True)
    return path


def read_output(task: Task) -> tuple[bytes, list[Diagnostic]]:
    """The declared output's bytes; a missing, linked, special or huge file is refused unread."""
    path = display(task.output)
    try:
        facts = task.output.lstat()
    except (FileNotFoundError, NotADirectoryError):
        hint = "the agent must write exactly the file that its task names"
        return b"", [error("ARTIFACT-MISSING", f"{task.stage} wrote no output", path=path, hint=hint)]
    if not stat.S_ISREG(facts.st_mode) or facts.st_nlink > 1:
        return b"", [error("ARTIFACT-LINK", f"the output of {task.stage} is not a separate plain file", path=path)]
    most = MAX_BYTES.get(task.stage, MAX_JSON_BYTES)
    if facts.st_size > most:
        text = f"the output of {task.stage} has {facts.st_size} bytes; at most {most} are read"
        return b"", [error("ARTIFACT-TOO-LARGE", text, path=path)]
    # Its agent may still be at work, and may put a link to what only octoform reads in its place meanwhile.
    return files.read(task.output, most, follow=False), []


def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
    """Parse, schema and rules: all that needs nothing but values."""
    value, found = read_value(task, data)
    if value is None:
        return None, found
    path = display(task.output)
    return value, found + check(task.stage, value, artifacts(context, task.stage, value), context.schemas, path)


def read_value(task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
    """The output as a value; None with the reasons when it cannot be read."""
    value, found = parse(task.stage, data, display(task.output))
    return (None, found) if has_errors(found) else (value, found)


def artifacts(context: Context, stage: str, value: object) -> Artifacts:
    """The accepted artifacts before ``stage`` and the profile facts, as the rules want them."""
    loaded = accepted_before(context, stage)
    probe = value if stage == "probe" else loaded.get("probe")
    manifest = context.manifest
    held = {profile.name: devices_of(profile, probe, manifest.answers) for profile in context.profiles}
    facts = {
        item.name: ProfileFacts(item.name, held[item.name], item.limits, commands(item), item.product, definition(item))
        for item in context.profiles
    }
    budget = manifest.budget_for("interface").tools
    registered = _registered(probe, context) if stage == "identify" and isinstance(probe, Mapping) else None
    known = Artifacts(**loaded, profiles=facts, answers=manifest.answers, tools_budget=budget, registered=registered)
    known = replace(known, offered=offered(context.profiles, probe, manifest.answers) if stage != "probe" else {})
    return replace(known, python=".".join(map(str, sys.version_info[:3]))) if stage == "deploy" else known


def offered(chosen: Sequence[Profile], probe: object, answers: Mapping[str, str]) -> dict[str, str]:
    """By device the profile that comes with octoform, matches it, and that the manifest does not name."""
    if probe is None:
        return {}
    found = profile_parser.offered(shipped().glob("*.md"), chosen, probe, answers)
    return {device: each.profile for each in found for device in each.devices}


def _registered(probe: Mapping[str, Any], context: Context) -> dict[str, str]:
    """The entries of this host's id databases for each device with numbers; "" for an unknown one."""
    databases = IdDatabases(Path(context.environ.get("OCTOFORM_SYSROOT") or "/"))
    numbered = (device for device in probe["devices"] if device.get("vid") and device.get("pid"))
    return {
        device["id"]: " ".join(databases.lookup(device["interface"], device["vid"], device["pid"])).strip()
        for device in numbered
    }


def digest_of(context: Context, stage: str, value: object) -> str:
    """The canonical digest of an output: instances and times omitted."""
    return output_digest(stage, value, context.schemas)


# How the work on one node ended.


@dataclass(frozen=True, slots=True)
class Finished:
    """``verdict`` is the accepted one, or the last refusal; ``attempts`` counts the agent runs.

    ``program`` is the agent's program of the last of them with its version, where it is known.
    """

    verdict: Verdict
    attempts: int
    usage: Usage
    seconds: float
    program: str | None = None
