"""What the ledger says when it does not do what it was asked, and when somebody has changed its files. Light."""

from pathlib import Path

from octoform.claims.model import Claim
from octoform.diagnostics import Diagnostic, error, warning
from octoform.escaping import escaped
from octoform.state.files import shown


def over(claim: Claim) -> Diagnostic:
    """A pending claim has no fresh reading."""
    return error(
        "CLAIM-STALE",
        f"no reading of the last time bears {claim.id} out any more",
        hint="wait for a reading of its signal, then confirm it",
    )


def unknown(identity: str, how: str) -> Diagnostic:
    """No claim of that id is in such a state."""
    text = f"there is no claim {escaped(identity)[:60]} {how}"
    return error("CLAIM-NOT-FOUND", text, hint="octoform claims shows them")


def taken(path: Path) -> Diagnostic:
    """Another process stands still with the lock."""
    text = "the ledger of claims cannot be locked: another process stands still with it"
    return error("CLAIM-LEDGER-LOCK", text, path=str(path), hint="end that process; fuser tells which one it is")


def nobody() -> Diagnostic:
    """A decision without a name."""
    return error("CLAIM-NO-PERSON", "nobody answers for it", hint="say who you are")


def changed(path: Path) -> Diagnostic:
    """A file of the ledger was changed while nobody but the daemon may."""
    return warning(
        "CLAIM-LEDGER-CHANGED",
        "the ledger of claims was changed by somebody else while an agent was at work; it is as it was before",
        path=shown(path),
        hint="octoform claims and octoform confirm say what a person decides",
    )
