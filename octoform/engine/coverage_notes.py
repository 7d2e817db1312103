"""What limits a report of coverage, in sentences: what is not there yet, out of date, edited, or not what it says."""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.state.layout import STAGES
from octoform.state.model import NodeState, Snapshot, Status


def notes(snapshot: Snapshot, artifacts: Mapping[str, Any], files: Mapping[str, str | None]) -> Iterator[str]:
    """Stage by stage; ``artifacts`` are those that the report rests on, ``files`` the digests of what lies there."""
    never = []
    for name in STAGES:
        state = snapshot.nodes.get(name)
        if state is not None:
            yield from (f"{name.upper()}: {text}" for text in _of(state, name in artifacts, files[name]))
        if state is not None and name in artifacts:
            yield from _older(name, state, snapshot)
        if state is None or not state.output_digest:
            never.append(name.upper())
    until = "; no tool can be called until then" if "interface" in artifacts else ""
    if never:
        yield f"not there yet: {', '.join(never)}; octoform apply makes it{until}"


def _of(state: NodeState, used: bool, digest: str | None) -> Iterator[str]:
    """What is to be said of one stage by itself."""
    if state.status is not Status.ACCEPTED:
        ended = "was interrupted" if state.status is Status.INTERRUPTED else "failed"
        kept = "what was accepted before is shown" if used else "nothing of it was accepted yet"
        yield f"its last run {ended}; {kept}"
    if used and digest != state.file_digest:
        yield "its accepted output was edited by hand; what lies there is shown"
    if not used and state.output_digest:
        left = "gone" if digest is None else "left aside, for it or what it rests on cannot be read"
        yield f"its accepted output is {left}; octoform apply makes it again"


def _older(name: str, state: NodeState, snapshot: Snapshot) -> Iterator[str]:
    before = [part for part in STAGES if f"input.{part}" in state.key_parts and part in snapshot.nodes]
    moved = [part for part in before if state.key_parts[f"input.{part}"] != snapshot.nodes[part].output_digest]
    if moved:
        yield f"{name.upper()}: made from an earlier output of {moved[0].upper()}; octoform apply renews it"
