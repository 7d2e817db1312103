"""What a person does about a trouble that is not tried any more: the same words wherever it is told. Light."""

from octoform.daemon.model import Kind

_BY_HAND = {
    Kind.HARDWARE_CHANGED: "octoform apply (octoform plan shows first what it would do)",
    Kind.FILE_DAMAGED: "octoform plan tells what is edited, octoform apply puts it right",
}
"""Where that is another command than one more try."""


def advice(kind: Kind, target: str) -> str:
    """What to do once it was given up, with the command."""
    return _BY_HAND.get(kind) or f"mend the cause, then: octoform heal -retry {target}"


def hint(kind: Kind, target: str) -> str:
    """The same for a message of one line."""
    return _BY_HAND.get(kind) or f"octoform heal -retry {target} tries again once the cause is mended"
