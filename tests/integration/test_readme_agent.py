"""The README's manifest for a coding agent, exactly as it stands there, from `validate` to a tool's answer."""

import json
import re
import runpy
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from bench_host import bench_host
from projects import AGENT, Project

TOP = Path(__file__).parents[2]
TOKEN, RENEWS = "sk-ant-oat-0123456789abcdef", "sk-ant-ort-fedcba9876543210"
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
if "CLAUDE_CODE_OAUTH_TOKEN" in os.environ:
    print(os.environ["CLAUDE_CODE_OAUTH_TOKEN"], file=sys.stderr)
    given = os.environ["CLAUDE_CODE_OAUTH_TOKEN"] == "{token}" and "{renews}" not in str(os.environ)
    with open(os.path.join(os.path.dirname(task["output"]), "login.txt"), "w") as file:
        file.write("token given, nothing that renews it" if given else "not as promised")
used = {{"inputTokens": 1000, "outputTokens": 100, "costUSD": 0.25, "costBasis": "list"}}
for line in (
    {{"type": "system", "subtype": "init"}},
    {{
        "type": "assistant",
        "message": {{
            "content": [
                {{"type": "tool_use", "id": "1", "name": "Read", "input": {{"file_path": task["input"]}}}},
                {{"type": "tool_use", "id": "2", "name": "Write", "input": {{"file_path": task["output"]}}}},
            ],
        }},
    }},
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
    good = {stage: read(stage) for stage in ("identify", "interface", "serve", "deploy")}
    (folder / "claude").write_text(PROGRAM.format(good=repr(good), token=TOKEN, renews=RENEWS))
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
        "OCTOFORM_SYSROOT": str(bench_host(tmp_path / "host")),
        "ANTHROPIC_API_KEY": "sk-ant-a-key-of-no-account-0123456789",
    }
    project.folder.mkdir(parents=True, exist_ok=True)
    (project.folder / "octopus.yaml").write_text(manifest)
    project.run("validate", status=0)
    assert "APPLY-PRICE-UNKNOWN" not in project.run("plan", status=0).text
    done = project.run("apply", "-auto-approve", status=0)
    assert "Apply complete" in done.out and "$1.00 (priced by claude-code)" in done.out
    assert "Read state/local/identify/output.json\n" in done.out and "Write server.py\n" in done.out
    costs = [json.loads(project.run("state", "show", "-json", stage).out)["usage"] for stage in ("identify", "serve")]
    assert [(cost["cost_usd"], cost["cost_source"]) for cost in costs] == [(0.25, "claude-code")] * 2
    assert '"celsius": 21.5' in project.run("call", "read_temperature", status=0).out


def test_a_person_who_is_logged_in_needs_no_key(program: Path, tmp_path: Path) -> None:
    """`login: true`: the agent gets the token of the login and nothing that renews it, and no file keeps it."""
    project = Project(tmp_path / "project", tmp_path / "outside", host="local")
    home = tmp_path / "person"
    (home / ".claude").mkdir(parents=True)
    project.environ = {
        "OCTOFORM_AGENTS": str(tmp_path / "agents"),
        "PATH": f"{program}:{project.environment()['PATH']}",
        "OCTOFORM_SYSROOT": str(bench_host(tmp_path / "host")),
        "HOME": str(home),
    }
    project.folder.mkdir(parents=True, exist_ok=True)
    manifest = (
        "version: 1\nhost: local\nharness: {name: claude-code, login: true}\nmodel: anthropic/claude-sonnet-4-5\n"
    )
    (project.folder / "octopus.yaml").write_text(manifest)
    assert "HARNESS-LOGIN" in project.run("validate", status=0).text
    assert "HARNESS-LOGIN" in project.run("plan", status=0).text
    refused = project.run("apply", "-auto-approve", status=1)
    assert "error[HARNESS-LOGIN]" in refused.err and "claude setup-token" in refused.err
    login = {"accessToken": TOKEN, "refreshToken": RENEWS, "expiresAt": (time.time() + 7200) * 1000}
    (home / ".claude/.credentials.json").write_text(json.dumps({"claudeAiOauth": login}))
    assert "HARNESS-LOGIN" not in project.run("validate", status=0).text
    checks = project.run("doctor").out
    assert "yours with claude-code" in checks and TOKEN not in checks
    done = project.run("apply", "-auto-approve", "-target", "interface", status=0)
    assert "Apply complete" in done.out
    lines = [path.read_text() for path in (project.folder / ".octoform").rglob("login.txt")]
    assert lines and set(lines) == {"token given, nothing that renews it"}
    files = [path for path in project.folder.rglob("*") if path.is_file() and not path.is_symlink()]
    assert not [path for path in files if any(secret.encode() in path.read_bytes() for secret in (TOKEN, RENEWS))]
    assert json.loads((home / ".claude/.credentials.json").read_text())["claudeAiOauth"] == login
