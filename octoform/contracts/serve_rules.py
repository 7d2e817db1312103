"""The whole SERVE contract over one source text: it compiles, and then every rule of the ten families."""

from dataclasses import replace

from octoform.contracts import (
    serve_actuate_rules,
    serve_code_rules,
    serve_device_rules,
    serve_exchange_rules,
    serve_line_rules,
    serve_loop_rules,
    serve_reading_rules,
    serve_tool_rules,
    serve_value_rules,
    serve_write_rules,
)
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.source import Source, read_source
from octoform.diagnostics import Diagnostic


def syntax(value: str, _: Artifacts) -> list[Diagnostic]:
    """The text compiles."""
    source = read_source(value)
    return [] if isinstance(source, Source) else [source]


# `syntax` comes first: the others are not asked about a text that it refuses.
RULES = (
    Rule("SERVE-SYNTAX", syntax),
    *serve_code_rules.RULES,
    *serve_device_rules.RULES,
    *serve_loop_rules.RULES,
    *serve_tool_rules.RULES,
    *serve_actuate_rules.RULES,
    *serve_reading_rules.RULES,
    *serve_value_rules.RULES,
    *serve_write_rules.RULES,
    *serve_line_rules.RULES,
    *serve_exchange_rules.RULES,
)


def serve_static(source: str, interface: JsonObject, path: str = "server.py") -> list[Diagnostic]:
    """Everything that the text of a server shows to be wrong, each with line and column; nothing is run."""
    artifacts = Artifacts(interface=interface)
    found = syntax(source, artifacts)
    if not found:
        found = [item for rule in RULES for item in rule.check(source, artifacts)]
    return [replace(item, path=path) for item in found]
