"""``schema``: print the JSON Schema of octopus.yaml."""

from argparse import Namespace
from pathlib import Path

from octoform.manifest.schema.document import json_schema
from octoform.views.format import output
from octoform.views.format.console import Console


def run(_: Namespace, __: Path, screen: Console) -> int:
    """The schema that editors use."""
    return output.document(screen, json_schema())
