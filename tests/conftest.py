"""What tests of every package may use: the invented hosts of tests/hosts as trees on disk."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hosts.plant import plant


@pytest.fixture
def planted(tmp_path: Path) -> Callable[..., Path]:
    """``planted("laptop")`` builds that host's tree and returns its root; a second argument changes its text."""
    count = 0

    def build(name: str, replace: dict[str, str] | None = None) -> Path:
        nonlocal count
        count += 1
        return plant(name, tmp_path / f"{name}-{count}", replace)

    return build
