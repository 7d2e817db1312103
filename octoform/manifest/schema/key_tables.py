"""Which keys may stand where in a manifest, for what is said of a key that may not. (Heavy: the document.)"""

from pydantic import BaseModel

from octoform.manifest import agent_locations
from octoform.manifest.schema.daemon import Daemon, Notify
from octoform.manifest.schema.document import (
    Budget,
    Document,
    Escalation,
    Git,
    Housekeeping,
    IdentifyStage,
    Lifecycle,
    Perception,
    Price,
    Stage,
    StageBudget,
    Stages,
)
from octoform.manifest.schema.harness import CommandHarness, Confinement, ProgramHarness, table_of
from octoform.manifest.schema.network import Network, Tunnel
from octoform.manifest.schema.policy import Limit, Policy, Rule
from octoform.manifest.source import tree
from octoform.manifest.source.tree import Loc, Scalar, Table

# Also where a key belongs that stands elsewhere; the first place counts.
_PLACES: tuple[tuple[Loc, type[BaseModel]], ...] = (
    ((), Document),
    (("budget",), Budget),
    (("lifecycle",), Lifecycle),
    (("git",), Git),
    (("stages",), Stages),
    (("harness",), CommandHarness),
    (("harness",), ProgramHarness),
    (("housekeeping",), Housekeeping),
    (("policy",), Policy),
    (("network",), Network),
    (("tunnel",), Tunnel),
    (("perception",), Perception),
    (("stages", "identify"), IdentifyStage),
    (agent_locations.ESCALATION, Escalation),
    (("daemon",), Daemon),
    (("daemon", "notify"), Notify),
)
_TABLES = dict(reversed(_PLACES))
_ITEMS: dict[Loc, type[BaseModel]] = {("policy", "rules"): Rule, ("policy", "limits"): Limit}


def keys_at(root: Table, loc: Loc) -> tuple[str, ...]:
    """The keys that the table at a path may have."""
    table = _TABLES.get(loc)
    if loc[-1:] == ("harness",):
        entry = tree.at(root, (*loc, "name"))
        table = table_of(entry.text if isinstance(entry, Scalar) else "")
    elif loc[-1:] == ("sandbox",):
        table = Confinement
    elif loc[:1] == ("prices",):
        table = Price
    elif loc[:-1] in _ITEMS:
        table = _ITEMS[loc[:-1]]
    elif table is None:
        table = StageBudget if loc[-1] == "budget" else Stage
    return tuple(sorted(table.model_fields, key=lambda name: name != "name"))


def home_of(loc: Loc) -> Loc | None:
    """The table where a key belongs that stands at a path where nothing has that name; None for one unknown."""
    name = str(loc[-1])
    if loc[-2:-1] == ("harness",) and name in ProgramHarness.model_fields | CommandHarness.model_fields:
        return None  # a setting of another kind of agent
    return next((place for place, table in _PLACES if name in table.model_fields), None)
