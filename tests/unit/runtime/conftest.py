"""A small system root, and the environment of a running server."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sysfs_tree import Tree


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tree:
    """An empty system root that the runtime looks at."""
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(tmp_path / "root"))
    monkeypatch.delenv("OCTOFORM_INSTANCES", raising=False)
    return Tree(tmp_path / "root")


@pytest.fixture
def instances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[dict[str, Any]], Path]:
    """Write the instances file and point the runtime at it."""

    def write(devices: dict[str, Any]) -> Path:
        path = tmp_path / "instances.json"
        path.write_text(json.dumps({"format": 1, "devices": devices}))
        monkeypatch.setenv("OCTOFORM_INSTANCES", str(path))
        return path

    return write
