"""Commands on agents: their programs, their attempts, and what they work with.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

from octoform.cli.table import Json, flag, number, operand, operands, option, optional, repeated, setting
from octoform.diagnostics import did_you_mean, has_errors

TYPE_CHECKING = False
if TYPE_CHECKING:
    from octoform.cli.dispatch import Run


class InstallArguments(Json):
    """Of ``install``."""

    harness: list[str] = operands("HARNESS", "a harness of octopus.yaml, such as pi or codex", required=True)


def run_install(arguments: InstallArguments, run: Run) -> int:
    """Exit code 1 when one of them could not be installed."""
    from octoform.engine.doctor import install
    from octoform.views import doctor

    result = install(arguments.harness, run.environ, doctor.steps(run.screen))
    return doctor.show_installation(run.screen, result, as_json=run.as_json)


def run_doctor(_: Json, run: Run) -> int:
    """Exit code 1 when something that is needed failed, or the manifest cannot be read."""
    from octoform.engine.doctor import diagnose
    from octoform.views import doctor

    found = diagnose(*run.here)
    if has_errors(found.diagnostics):
        return run.show(*found.diagnostics)
    return doctor.show(run.screen, found, as_json=run.as_json)


def _stage(text: str) -> str:
    from octoform.protocol.model import DUTIES
    from octoform.state.layout import STAGES, STEP

    known = (*STAGES, *DUTIES)
    if text not in known and not text.startswith(STEP):
        near = did_you_mean(text, known)
        raise ValueError(f"there is no stage {text!r}" + (f"; did you mean {near}?" if near else ""))
    return text


class AttemptsArguments(Json):
    """Of ``attempts``."""

    stage: str | None = option(_stage, "STAGE", "only the attempts of this stage")
    all: bool = flag("all attempts that are kept, not only the latest")


def run_attempts(arguments: AttemptsArguments, run: Run) -> int:
    """The latest last."""
    from octoform.engine.inspect.attempts import listed
    from octoform.views import attempts

    return run.answer(listed(*run.here, arguments.stage), partial(attempts.listing, everything=arguments.all))


class AttemptsShowArguments(Json):
    """Of ``attempts show``."""

    attempt: int = operand(number, "N")


def run_attempts_show(arguments: AttemptsShowArguments, run: Run) -> int:
    """Prompt, tool calls, problems, cost."""
    from octoform.engine.inspect.attempts import detail
    from octoform.views import attempts

    return run.answer(detail(*run.here, arguments.attempt), attempts.one)


class AttemptsRecordArguments(Json):
    """Of ``attempts record``."""

    folder: str = operand(str, "DIR")
    first: int = setting(number, "N", "begin with attempt N", "-from", "--from", default="1")


def run_attempts_record(arguments: AttemptsRecordArguments, run: Run) -> int:
    """A folder for the harness replay."""
    from octoform.engine.recording import record
    from octoform.views import attempts

    made, found = record(*run.here, Path(arguments.folder).absolute(), arguments.first)
    return run.answer((None if has_errors(found) else made, found), attempts.recorded, noted=True)


class SpecArguments(Json):
    """Of ``spec diff`` and ``spec reset``."""

    stage: str | None = optional("STAGE")


def run_spec_diff(arguments: SpecArguments, run: Run) -> int:
    """What agents corrected in their specs."""
    from octoform.engine import spec_edits
    from octoform.views import state

    edits, found = spec_edits.waiting(*run.here, arguments.stage)
    return run.answer((None if has_errors(found) else edits, found), state.diff, noted=True)


class SpecPromoteArguments(Json):
    """Of ``spec promote``."""

    stage: str = operand(str, "STAGE")


def run_spec_promote(arguments: SpecPromoteArguments, run: Run) -> int:
    """Make a correction permanent."""
    from octoform.engine import spec_edits
    from octoform.views import state

    found = spec_edits.promote(*run.here, arguments.stage)
    return run.answer((None if has_errors(found) else arguments.stage, found), state.promoted, noted=not run.as_json)


def run_spec_reset(arguments: SpecArguments, run: Run) -> int:
    """Drop corrections."""
    from octoform.engine import spec_edits
    from octoform.views import state

    dropped, found = spec_edits.reset(*run.here, arguments.stage)
    return run.answer((None if has_errors(found) else dropped, found), state.dropped, noted=not run.as_json)


class ProfileNewArguments(Json):
    """Of ``profile new``."""

    device: str = operand(str, "DEVICE")


def run_profile_new(arguments: ProfileNewArguments, run: Run) -> int:
    """Exit code 1 when it cannot be drafted."""
    from octoform.engine.profiles import draft
    from octoform.views import profiles

    return run.answer(draft(*run.here, arguments.device), profiles.drafted)


class ProfileCheckArguments(Json):
    """Of ``profile check``."""

    file: str = operand(str, "FILE")


def run_profile_check(arguments: ProfileCheckArguments, run: Run) -> int:
    """Exit code 1 when it is not sound."""
    from octoform.engine.profiles import check
    from octoform.views import profiles

    report, found = check(*run.here, Path(arguments.file))
    if report is None or has_errors(found):
        return run.show(*found)
    if not run.as_json:
        run.note(*found)
    return profiles.report(run.screen, arguments.file, report, as_json=run.as_json)


class SimulateArguments(Json):
    """Of ``simulate``."""

    rig: str = operand(str, "RIG", "the name of a rig, such as reference, or a .yaml file")
    folder: str | None = option(
        str, "DIR", "create the devices in DIR, empty or missing so far (default: a new folder)"
    )
    set: list[str] = repeated(
        "NAME.KEY=VALUE",
        "change a value of the rig's description, such as arm.anonymous=true; may be given more than once",
    )


def run_simulate(arguments: SimulateArguments, run: Run) -> int:
    """Does not return; the program leaves with 0 when it was ended, with 1 when it could not begin."""
    command = [sys.executable, "-P", "-m", "octoform.simulation", _rig(arguments.rig, run.project)]
    if arguments.folder is not None:
        command += ["-folder", str(run.project / arguments.folder)]
    for text in arguments.set:
        command += ["-set", text]
    if arguments.json:
        command.append("-json")
    sys.stdout.flush()
    os.execv(sys.executable, command)


def _rig(rig: str, project: Path) -> str:
    """A project's own ``profiles/rigs/NAME.yaml`` takes the place of a shipped one of that name."""
    own = project / "profiles" / "rigs" / f"{rig}.yaml"
    if own.is_file():
        return str(own)
    return str(project / rig) if rig.endswith(".yaml") else rig
