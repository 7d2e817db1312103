"""Privileged steps as words: they move hardware, so a plan says what, and why one would be skipped."""

from octoform.graph.model import STEP
from octoform.plan.model import StepOutlook
from octoform.views.text import one_line

WIDTH = 100
_LOOKS = {"reading": ("read", "reads"), "view": ("look at", "looks at")}


def told(step: StepOutlook, *, certain: bool) -> str:
    """What a step does, as the end of a sentence that begins with its name."""
    if step.skipped:
        return _skipped(step)
    plural = not certain
    move, take = ("may move", "may take") if plural else ("moves", "takes")
    after = " (known after apply)" if plural or step.devices is None else ""
    if step.kind == "frame":
        through = one_line(", ".join(step.devices), WIDTH) if step.devices else "the camera that it chooses"
        return f"{take} pictures through {through}{after}"
    infinitive, third = _LOOKS[step.kind]
    return f"{move} {_what(step)} and {infinitive if plural else third} it before and after{after}"


def _what(step: StepOutlook) -> str:
    if step.devices:
        return one_line(" or ".join(step.devices), WIDTH)
    return f"what {step.profile} holds for" if step.profile else "a device"


def _skipped(step: StepOutlook) -> str:
    if step.profile is None:
        return "is skipped: there is no camera"
    text = f"is skipped: no device is corroborated by {step.profile}"
    if step.near is None:
        return text
    return f"{text}; {one_line(step.near, WIDTH)} lacks a word such as {one_line(step.word or '', WIDTH)}"


def folder(node: str) -> str:
    """Where the accepted files of a node lie, below ``state/HOST``."""
    return f"steps/{node.removeprefix(STEP)}" if node.startswith(STEP) else node


def spec(node: str) -> str:
    """The file of a node's spec, below ``protocol``."""
    return f"privileged/{node.removeprefix(STEP)}.md" if node.startswith(STEP) else f"{node}.md"
