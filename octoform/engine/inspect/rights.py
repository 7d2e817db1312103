"""The served devices that this user may not use, asked now: what an apply, the doctor and the coverage tell of them."""

from collections.abc import Mapping

from octoform.diagnostics import Diagnostic, warning
from octoform.endpoint.access.rights import describe, served
from octoform.engine.inspect.devices import attached
from octoform.state.artifacts.cache import classes_of, read_instances
from octoform.state.layout import Layout

CODE = "ENDPOINT-NO-RIGHTS"


def lacking(layout: Layout, environ: Mapping[str, str]) -> dict[str, str]:
    """A sentence for each device of the endpoint's tools with a node that this user may not use, by device id."""
    ledger = read_instances(layout)[0] or {}
    asked = {name: classes for name in served(layout) if (classes := classes_of(ledger.get(name)))}
    now = attached(layout, environ, asked) if asked else {}
    return {name: "; ".join(map(describe, each.refused)) for name, each in now.items() if each.refused}


def diagnostics(shut: Mapping[str, str]) -> tuple[Diagnostic, ...]:
    """What `lacking` found as warnings: the deployment stands, and the tools of these devices answer with an error."""
    hint = "octoform doctor looks again; no other apply is needed"
    return tuple(warning(CODE, f"{name} cannot be used: {why}", hint=hint) for name, why in sorted(shut.items()))
