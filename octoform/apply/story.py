"""The log of a failed attempt as its successor can use it.

What a coding-agent program prints is a stream of records for machines, of which a few kilobytes say nothing. Its
transcript says the same in one line for each thing that it did.
"""

from pathlib import Path

from octoform.base.files import replace
from octoform.harness import transcript
from octoform.harness.port import AgentEvent, Closed, Outcome, Said, Task, ToolCalled, ToolReturned, Trouble

FILE_NAME = "story.txt"
MOST_LINES = 400


def readable_log(task: Task, outcome: Outcome) -> Path:
    """The file to quote from: the story of a program whose output was read, else the log as it is.

    OSError when the attempt's folder cannot be written.
    """
    if outcome.turns is None:
        return task.log
    told = [(moment.at, _line(moment.event)) for moment in transcript.read(task.transcript)]
    lines = [f"{at:7.1f} s  {text}" for at, text in told if text]
    if not lines:
        return task.log
    story = task.workdir / FILE_NAME
    replace(story, "".join(f"{line}\n" for line in lines[-MOST_LINES:]).encode(), 0o644, synced=False)
    return story


def _line(event: AgentEvent) -> str:
    match event:
        case Said():
            return f"said: {event.text}" if event.text else ""
        case ToolCalled():
            return f"{event.tool}: {event.text}"
        case ToolReturned():
            return "  that failed" if event.failed else ""
        case Trouble():
            return f"the model's side failed: {event.text}"
        case Closed():
            return f"it ended: {event.text}" if event.text else ""
    return ""
