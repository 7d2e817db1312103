"""``schema``: print the JSON Schema of octopus.yaml."""

from argparse import Namespace
from pathlib import Path

from octoform.manifest.schema import json_schema
from octoform.views import texts
from octoform.views.console import Console


def run(_: Namespace, __: Path, screen: Console) -> int:
    """The schema that editors use."""
    return texts.document(screen, json_schema())
