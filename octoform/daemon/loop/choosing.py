"""Which repairs there are for a trouble, how often each may be made, and which are re-discoveries. Light.

Pure: what was tried so far is known by the breakers.
"""

from octoform.daemon.loop.barring import HARMLESS
from octoform.daemon.model import Done, Finding, Repair
from octoform.daemon.records.breakers import FLAPS

PASSIVE = frozenset({Repair.NONE, Repair.WAIT, Repair.PERSON})
QUICK = HARMLESS | {Repair.RESTART}
"""Done in a moment, and cheap: for these the bound of an hour is that of what comes back again and again."""
EVIDENCES = 3
"""How many evidences of one target and class may have all of their tries within an hour."""


def chain_of(finding: Finding) -> tuple[Repair, ...]:
    """The repairs that there are for a finding, in the order in which they are tried."""
    return tuple(repair for repair in (finding.repair, *finding.then) if repair not in PASSIVE)


def limit_of(finding: Finding, most: int) -> int:
    """How many tries there are; fewer where the judge sends for a person after the last of its repairs."""
    return min(most, len(chain_of(finding))) if Repair.PERSON in finding.then else most


def most_in_hour(repair: Repair, most: int) -> int:
    """How many tries one target and class have in an hour, whatever their evidence; ``most`` are those of one."""
    return FLAPS if repair in QUICK else EVIDENCES * most


def rediscovers(repair: Repair | None, done: Done) -> bool:
    """True for a try that was a re-discovery, or a HEAL that asked for one."""
    asked = repair is Repair.HEAL and (done.report or {}).get("action") == Repair.REDISCOVER
    return asked or repair is Repair.REDISCOVER
