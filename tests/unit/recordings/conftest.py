"""The scorer's modules are scripts beside `run.py`, so their folder is put on the path as running it would do."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "recordings"))
