"""Load octopus.yaml: bytes, text, tree, rules, value; every problem at once. (Heavy: YAML reader and pydantic.)"""

from collections.abc import Mapping
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.manifest import crosschecks, profile_paths, schema_errors, text_values
from octoform.manifest.conversion import build
from octoform.manifest.model import Manifest, ProfileSource
from octoform.manifest.problem_list import ProblemList, read, text_of
from octoform.manifest.yaml_parser import read_tree
from octoform.records import replace


def load(path: Path, environ: Mapping[str, str]) -> tuple[Manifest | None, list[Diagnostic]]:
    """The manifest of a file, or None and what is wrong with it; warnings come along with a manifest.

    ``path`` is shown in diagnostics as it is given. ``environ`` is only asked whether variables are set. Never raises
    for what is in the file; what cannot be decoded or parsed is one problem, everything after that is gathered.
    """
    report = ProblemList(str(path))
    content = read(path, report)
    if content is None:
        return None, report.diagnostics()
    return parse(content, path, environ)


def parse(content: bytes, path: Path, environ: Mapping[str, str]) -> tuple[Manifest | None, list[Diagnostic]]:
    """As `load`, of bytes that may not yet stand at ``path``."""
    report = ProblemList(str(path))
    text = text_of(content, report)
    root = read_tree(text, report) if text is not None else None
    if root is None:
        return None, report.diagnostics()
    text_values.check_secrets(root, report)
    variables = text_values.check_references(root, environ, report)
    absolute = path.absolute()
    profiles = profile_paths.check(root, absolute.parent, report)
    crosschecks.check_recordings(root, absolute.parent, report)
    crosschecks.check_commands(root, report)
    document = schema_errors.check(root, report)
    if document is not None:
        crosschecks.check(document, root, report)
        crosschecks.check_scope(document, root, report)
        text_values.check(document, root, environ, report)
    if document is None or report.failed:
        return None, report.diagnostics()
    manifest = build(document, absolute, profiles, variables, environ)
    return replace(manifest, privileged_steps=crosschecks.named_steps(root, report)), report.diagnostics()


def named_profiles(path: Path) -> tuple[ProfileSource, ...]:
    """The profiles that a manifest names and that are there, also of a manifest with problems.

    So that the problems of all files can be reported at once; `load` reports what is wrong with the manifest.
    """
    report = ProblemList(str(path))
    content = read(path, report)
    text = text_of(content, report) if content is not None else None
    root = read_tree(text, report) if text is not None else None
    return profile_paths.check(root, path.absolute().parent, report) if root is not None else ()
