"""What a plan with nothing to do reads comes without any heavy import."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HEAVY = ("pydantic", "git", "jsonschema", "ruamel", "jinja2", "rich", "tempfile", "subprocess")
LIGHT = (
    *("layout", "files", "store.quick_read", "store.journal", "store.lock"),
    *("accepted", "artifact_cache", "git_head"),
)


@pytest.mark.parametrize("module", LIGHT)
def test_a_light_module_imports_nothing_heavy(module: str) -> None:
    program = f"import sys; import octoform.state.{module}; print([name for name in {HEAVY!r} if name in sys.modules])"
    run = subprocess.run(
        [sys.executable, "-S", "-c", program], cwd=ROOT, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert (run.stdout.strip(), run.stderr) == ("[]", "")
