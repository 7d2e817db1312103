"""Folders of any name: what JSON can name works, what it cannot is refused in one sentence before anything is done."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from projects import OCTOFORM

LATIN = os.fsdecode(b"ger\xe4te")


def octoform(folder: Path, *words: str, **environ: str) -> "subprocess.CompletedProcess[bytes]":
    environ = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", **environ}
    return subprocess.run([OCTOFORM, *words], cwd=folder, env=environ, capture_output=True, timeout=60, check=False)


@pytest.mark.parametrize("command", ["init", "plan", "apply", "status", "call", "estop"])
def test_a_folder_whose_name_is_no_utf8_is_refused(command: str, tmp_path: Path) -> None:
    (folder := tmp_path / LATIN).mkdir()
    done = octoform(folder, command)
    assert done.returncode == 1 and b"Traceback" not in done.stderr
    assert b"error[PROJECT-NAME]: the name of the folder is not UTF-8" in done.stderr and b"\\xe4te" in done.stderr
    assert list(folder.iterdir()) == []


def test_so_is_a_recorded_host_and_as_json(tmp_path: Path) -> None:
    done = octoform(tmp_path, "validate", "-json", OCTOFORM_SYSROOT=f"/{LATIN}")
    assert done.returncode == 1
    assert [item["code"] for item in json.loads(done.stdout)["diagnostics"]] == ["PROJECT-NAME"]


def test_what_needs_no_folder_is_answered_there(tmp_path: Path) -> None:
    (folder := tmp_path / LATIN).mkdir()
    assert octoform(folder, "version").returncode == 0


@pytest.mark.parametrize("name", ["ger\u00e4te \u4e2d\u6587", "new\nline", "quo'te \"`id` $x", "-dash"])
def test_any_other_name_is_a_name(name: str, tmp_path: Path) -> None:
    (folder := tmp_path / name).mkdir()
    assert octoform(folder, "init").returncode == 0
    assert octoform(folder, "validate").returncode == 0
