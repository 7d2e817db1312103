"""Setting up on a disk that is too small ends in one sentence, and leaves nothing that the next run takes for whole."""

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
PYTHON = """#!/bin/sh
case "$1$2" in
-mvenv) mkdir -p .venv/bin; : > .venv/bin/python; chmod +x .venv/bin/python; echo "it left with status 1" >&2; exit 1 ;;
*hashlib*) echo 0123456789abcdef ;;
esac
"""
DF = "#!/bin/sh\necho Filesystem 1024-blocks Used Available Capacity Mounted on\necho none 51200 40960 {0} 80% /\n"


def setup(folder: Path, left: int) -> "subprocess.CompletedProcess[str]":
    for name, text in (("python3.11", PYTHON), ("df", DF.format(left))):
        program = folder / "programs" / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(text)
        program.chmod(0o755)
    (folder / "a folder" / ".ci").mkdir(parents=True, exist_ok=True)
    for name in (".ci/setup", ".ci/requirements.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / "a folder" / name)
    environ = {"PATH": f"{folder}/programs:{os.environ['PATH']}", "HOME": str(folder)}
    command = ["bash", str(folder / "a folder" / ".ci" / "setup")]
    return subprocess.run(command, env=environ, capture_output=True, text=True, check=False)


def test_a_disk_that_is_too_small_is_named(tmp_path: Path) -> None:
    done = setup(tmp_path, 10 * 1024)
    assert done.returncode == 1
    assert "this file system has 10 MB left" in done.stderr and "free some space" in done.stderr
    assert not (tmp_path / "a folder" / ".venv").exists()


def test_another_reason_is_not_taken_for_a_full_disk(tmp_path: Path) -> None:
    done = setup(tmp_path, 10 * 1024 * 1024)
    assert done.returncode == 1 and "MB left" not in done.stderr
    assert "could not make .venv" in done.stderr and not (tmp_path / "a folder" / ".venv").exists()
