"""A plan with nothing to do, and the help: what a person waits for most often. (python bench/plan_noop.py)"""

import shutil
import subprocess
import sys
from pathlib import Path

from measuring import OCTOFORM, PYTHON, Command, Row, environment, imported, in_turns, report, scratch
from subjects import inside, project

ROUNDS = 20
PLAN_BOUND, PLAN_AIM, HELP_BOUND = 0.10, 0.08, 0.04
OF_TERRAFORM = 1.3
"""How many times as much a plan with nothing to do may cost as terraform's."""
LOOP = "for i in range(10**7): pass"
STAGES = ("probe", "identify", "interface", "serve", "deploy")


def chained() -> str:
    """Five units for terraform, each with the output of the one before as its input."""
    inputs = ['"1"', *(f"terraform_data.{name}.output" for name in STAGES[:-1])]
    blocks = zip(STAGES, inputs, strict=True)
    return "".join(f'resource "terraform_data" "{name}" {{\n  input = {given}\n}}\n' for name, given in blocks)


def terraform(folder: Path) -> Command | None:
    """Terraform with the same five chained units and nothing to do, where it is installed."""
    program = shutil.which("terraform")
    if program is None:
        return None
    made = folder / "terraform"
    made.mkdir()
    (made / "main.tf").write_text(chained())
    for arguments in (["init"], ["apply", "-auto-approve"]):
        command = [program, *arguments, "-input=false"]
        subprocess.run(command, cwd=made, env=environment(), check=True, stdout=subprocess.DEVNULL)
    return Command("terraform plan, five chained units", [program, "plan", "-input=false"], made)


def heavy(folder: Path) -> list[str]:
    """Sentences about heavy libraries that a light command imports; empty when all is well."""
    found = {title: imported(argv, folder) for title, argv in (("plan", ["plan"]), ("--help", ["--help"]))}
    return [f"octoform {title} imports {', '.join(names)}" for title, names in found.items() if names]


def main() -> int:
    """Measure, print, and say whether the bounds hold."""
    with scratch() as folder:
        subject = project(folder)
        inside(subject.folder, "apply", "-auto-approve")
        bare = Command("python -I -S -c pass", [PYTHON, "-I", "-S", "-c", "pass"], folder)
        loop = Command(f"python, {LOOP}", [PYTHON, "-I", "-S", "-c", LOOP], folder)
        plan = Command("octoform plan, nothing to do", [OCTOFORM, "plan"], subject.folder)
        usage = Command("octoform --help", [OCTOFORM, "--help"], subject.folder)
        other = terraform(folder)
        found = in_turns([bare, loop, plan, usage, *([other] if other else [])], ROUNDS)
        imports = heavy(subject.folder)
    aim = f"aim {PLAN_AIM:.2f} {'reached' if found[plan.title] <= PLAN_AIM else 'not reached'}"
    rows = [
        Row(plan.title, found[plan.title], bound=PLAN_BOUND, note=aim),
        Row(usage.title, found[usage.title], bound=HELP_BOUND),
        Row(bare.title, found[bare.title], note="what the interpreter itself takes"),
        Row(loop.title, found[loop.title], note="how fast the machine is now"),
    ]
    if other is not None:
        ratio = found[plan.title] / found[other.title]
        rows.append(Row(other.title, found[other.title], note="for comparison"))
        rows.append(Row("octoform plan, as a multiple of terraform plan", ratio, unit="x", bound=OF_TERRAFORM))
    said = imports or ["neither imports a heavy library (fastmcp, litellm, cv2, git, pydantic, rich ...)"]
    status = report("plan_noop: median CPU of rounds in turns, ratio to the plan", rows, rows[0], said)
    return 1 if imports else status


if __name__ == "__main__":
    sys.exit(main())
