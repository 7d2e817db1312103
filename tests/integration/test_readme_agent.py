"""The README's manifest for a coding agent, exactly as it stands there, from `validate` to a tool's answer."""

import json
import re
import runpy
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from projects import AGENT, Project

TOP = Path(__file__).parents[2]
PROGRAM = '''#!/usr/bin/python3
"""Stands for the program: does each stage's work at once, and prints the stream that it prints."""

import json, os, sys

GOOD = {good}

if "--version" in sys.argv:
    print("2.1.330 (Claude Code)")
    sys.exit()
with open(os.environ["OCTOFORM_TASK"]) as file:
    task = json.load(file)
with open(task["output"], "w") as file:
    file.write(GOOD[task["stage"]])
used = {{"inputTokens": 1000, "outputTokens": 100, "costUSD": 0.25, "costBasis": "list"}}
for line in (
    {{"type": "system", "subtype": "init"}},
    {{
        "type": "result",
        "subtype": "success",
        "is_error": False,
        "result": "done",
        "usage": {{"input_tokens": 1000, "output_tokens": 100}},
        "modelUsage": {{sys.argv[sys.argv.index("--model") + 1]: used}},
    }},
):
    print(json.dumps(line), flush=True)
'''


@pytest.fixture
def program() -> Iterator[Path]:
    """A folder with `claude`, which every user may read: root's agent is another one in the sandbox."""
    folder = Path(tempfile.mkdtemp(prefix="octoform-program-"))
    read = runpy.run_path(str(AGENT))["good"]
    good = {stage: read(stage) for stage in ("probe", "identify", "interface", "serve", "deploy")}
    (folder / "claude").write_text(PROGRAM.format(good=repr(good)))
    (folder / "claude").chmod(0o755)
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


def test_the_manifest_of_the_readme_runs_as_written_and_says_what_it_cost(
    program: Path, tmp_path: Path, environments: Path
) -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", (TOP / "README.md").read_text(), re.DOTALL)
    (manifest,) = [block for block in blocks if "harness: claude-code" in block]
    project = Project(tmp_path / "project", tmp_path / "outside", host="local")
    project.share_environments(environments)
    project.environ = {
        "OCTOFORM_AGENTS": str(tmp_path / "agents"),
        "PATH": f"{program}:{project.environment()['PATH']}",
        "ANTHROPIC_API_KEY": "sk-ant-a-key-of-no-account-0123456789",
    }
    project.folder.mkdir(parents=True, exist_ok=True)
    (project.folder / "octopus.yaml").write_text(manifest)
    project.run("validate", status=0)
    assert "APPLY-PRICE-UNKNOWN" not in project.run("plan", status=0).text
    done = project.run("apply", "-auto-approve", status=0)
    assert "Apply complete" in done.out and "$1.25 (priced by claude-code)" in done.out
    costs = [json.loads(project.run("state", "show", "-json", stage).out)["usage"] for stage in ("probe", "serve")]
    assert [(cost["cost_usd"], cost["cost_source"]) for cost in costs] == [(0.25, "claude-code")] * 2
    assert '"celsius": 21.5' in project.run("call", "read_temperature", status=0).out
