"""The first octopus.yaml of a host: complete, commented, and valid as it is.

Light: a person's first command should not wait for a YAML reader to copy a string.
"""

import os
import platform
from importlib import resources
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.manifest import model_url
from octoform.manifest.model import FILE_NAME

SCHEMA_FILE = "protocol/schemas/octopus.v1.schema.json"
_NO_SCHEMA = """\
# An editor checks this file with its schema: `octoform schema > octopus.schema.json`, and as the first line here
# "yaml-language-server: $schema=octopus.schema.json" as a comment.
#
"""


def starter_text(host: str, schema: str | None = None) -> str:
    """The text of a starter manifest; ``schema`` is the path of the schema file as the manifest shall name it."""
    head = f"# yaml-language-server: $schema={schema}\n#\n" if schema else _NO_SCHEMA
    body = resources.files("octoform.manifest").joinpath("starter.yaml").read_text("utf-8")
    return head + body.replace("@HOST@", _quoted(host))


def start_project(project: Path, host: str | None) -> tuple[Path | None, list[Diagnostic]]:
    """Write octopus.yaml unless there is one; the host is named after this machine when no name is given."""
    path = project / FILE_NAME
    named, found = write_starter(path, host, platform.node())
    return (None if named is None else path), found


def write_starter(path: Path, host: str | None, machine: str) -> tuple[str | None, list[Diagnostic]]:
    """Write a starter manifest to a path where nothing is; the host's name in it, or None and the reason.

    ``host`` is the name that a person chose; without it one is made of ``machine``, the machine's own name. The schema
    is named for editors where the project has the file.
    """
    chosen = model_url.host_of_machine(machine) if host is None else host
    if not model_url.is_legal_host(chosen):
        fitting = model_url.nearest_host(chosen)
        return None, [
            error(
                "MANIFEST-WRONG-VALUE",
                "a host name has lower-case letters, digits and inner hyphens, at most 63",
                hint=f"did you mean `{fitting}`?" if fitting else "it becomes the name of a folder: state/<host>",
            )
        ]
    schema = SCHEMA_FILE if (path.parent / SCHEMA_FILE).is_file() else None
    try:
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        with os.fdopen(file, "w", encoding="utf-8", newline="\n") as out:
            out.write(starter_text(chosen, schema))
    except FileExistsError:
        return None, [
            error(
                "MANIFEST-EXISTS",
                f"{path.name} is here already",
                path=str(path),
                hint="edit it, or move it away first; `octoform validate` checks it",
            )
        ]
    except OSError as problem:
        reason = f"{path.name} cannot be written: {problem.strerror or problem}"
        return None, [error("MANIFEST-UNWRITABLE", reason, path=str(path))]
    return chosen, []


def _quoted(host: str) -> str:
    """A name that YAML would read as something else than text is quoted: ``1234``, ``null``, ``1e5``, ``0x1f``."""
    is_word = host[0].isalpha() and host not in ("null", "true", "false", "yes", "no", "on", "off")
    return host if is_word else f'"{host}"'
