"""Builds the tree of an invented host (sys, proc, dev, run) from its text in this folder.

``octoform/simulation/sysfs_tree.py`` describes the text. Run as a program it plants one host:
``python tests/hosts/plant.py laptop FOLDER``.
"""

import sys
from pathlib import Path

from octoform.simulation.sysfs_tree import Planter

HERE = Path(__file__).parent
NAMES = tuple(sorted(path.stem for path in HERE.glob("*.host")))


def plant(name: str, root: Path, replace: dict[str, str] | None = None) -> Path:
    """Build the host's tree in ``root``; ``replace`` changes its text first (another port, another serial number)."""
    text = (HERE / f"{name}.host").read_text()
    for old, new in (replace or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    Planter(root).plant(text)
    return root


if __name__ == "__main__":
    print(plant(sys.argv[1], Path(sys.argv[2])))
