"""A fork of the loaded command line is octoform as a shell would start it."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import warm
from projects import OCTOFORM

ENVIRON = {"PATH": os.environ["PATH"], "NO_COLOR": "1"}


@pytest.mark.parametrize(
    "words",
    [
        ["--version"],
        ["--help"],
        ["plan"],
        ["explain", "IDENTIFY-INVENTED-DEVICE"],
        ["explain", "NO-SUCH-CODE"],
        ["paln"],
        ["-chdir=nowhere", "plan"],
        ["validate", "--json"],
        ["schema"],
    ],
    ids=" ".join,
)
def test_it_prints_and_ends_as_the_program_does(words: list[str], tmp_path: Path) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhots: bench\nharness: größe\n")
    done = subprocess.run(
        [OCTOFORM, *words], cwd=tmp_path, env=ENVIRON, stdin=subprocess.DEVNULL, capture_output=True, timeout=60
    )
    assert warm.run(OCTOFORM, words, tmp_path, ENVIRON, 60) == (
        done.returncode,
        done.stdout.decode(),
        done.stderr.decode(),
    )


def test_a_run_has_its_own_environment_and_no_other(tmp_path: Path) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\nmodel: ${OWN_MODEL}\n")
    first = warm.run(OCTOFORM, ["validate"], tmp_path, {**ENVIRON, "OWN_MODEL": "some/model"}, 60)
    second = warm.run(OCTOFORM, ["validate"], tmp_path, ENVIRON, 60)
    assert (first[0], second[0]) == (0, 1), (first, second)


def test_what_takes_too_long_is_killed(tmp_path: Path) -> None:
    sleeping = f"harness: {{name: command, command: [{sys.executable}, -c, 'import time; time.sleep(600)']}}"
    (tmp_path / "octopus.yaml").write_text(f"version: 1\nhost: bench\n{sleeping}\n")
    begun = time.monotonic()
    with pytest.raises(subprocess.TimeoutExpired):
        warm.run(OCTOFORM, ["apply", "-auto-approve"], tmp_path, ENVIRON, 2)
    assert time.monotonic() - begun < 20


def test_what_a_command_imports_late_is_loaded_already(tmp_path: Path) -> None:
    program = tmp_path / "loaded.py"
    program.write_text("import sys\nprint({'octoform.engine.project_status', 'jsonschema'} <= set(sys.modules))\n")
    assert warm.run(program, [], tmp_path, ENVIRON, 60) == (0, "True\n", "")
