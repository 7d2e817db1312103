"""Where in a manifest an agent may be described, for the rules that look at the tree and need no document. Light."""

from octoform.manifest.model import KEEPERS, STAGES
from octoform.manifest.source.tree import Loc

ESCALATION: Loc = ("stages", "identify", "escalate")
HARNESSES: tuple[Loc, ...] = (
    ("harness",),
    *(("stages", name, "harness") for name in (*STAGES, *KEEPERS)),
    (*ESCALATION, "harness"),
)
KEYS: tuple[Loc, ...] = (*((*loc, "key") for loc in HARNESSES), ("housekeeping", "key"))
BASE_URLS: tuple[Loc, ...] = (*((*loc, "base_url") for loc in HARNESSES), ("housekeeping", "base_url"))
WEBHOOK: Loc = ("daemon", "notify", "webhook")
"""The URL that is told of troubles; whoever has it may write there, so it may be a secret as a whole."""
