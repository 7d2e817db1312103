"""What a check of an agent's surroundings says, and the checks of its program: there, the tried version, its node.

A check that could not be carried out, or whose answer proves nothing, is ``unknown``, which is not ``pass``.
"""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from octoform.harness import sandbox, walls
from octoform.harness.adapters.program import ProgramHarness
from octoform.harness.installed import Located, Pin
from octoform.harness.installing import node_version
from octoform.harness.node import at_least, dotted
from octoform.harness.starting import stated_version
from octoform.manifest.model import Sandbox

SOURCES = {"manifest": "named in octopus.yaml", "installed": "installed by octoform", "path": "found on PATH"}


class Status(StrEnum):
    """How a check ended."""

    PASS = "pass"
    FAIL = "fail"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Check:
    """One check: what was looked at, how it ended, what was seen, and what to do about it. No secret is in it."""

    name: str
    status: Status
    detail: str
    hint: str | None = None


def passed(name: str, detail: str) -> Check:
    """A check that went well."""
    return Check(name, Status.PASS, detail)


def failed(name: str, detail: str, hint: str | None = None) -> Check:
    """A check of something needed that is not as it must be."""
    return Check(name, Status.FAIL, detail, hint)


def unknown(name: str, detail: str, hint: str | None = None) -> Check:
    """A check that proves neither."""
    return Check(name, Status.UNKNOWN, detail, hint)


def program_checks(harness: ProgramHarness, environ: Mapping[str, str]) -> tuple[Check, ...]:
    """Program, version and node of a coding-agent program; starts it once for its version."""
    pin = harness.adapter.pin
    located = harness.locate(environ)
    install = f"octoform install {harness.name}"
    if located is None:
        return (failed("program", f"{pin.binary} is not installed", install),)
    path = shutil.which(located.argv[0], path=environ.get("PATH"))
    if path is None:
        detail = f"{located.argv[0]} ({SOURCES[located.source]}) is not there, or not executable"
        return (failed("program", detail, f"correct `command` in octopus.yaml, or leave it out and run {install}"),)
    there = passed("program", f"{path}, {SOURCES[located.source]}")
    version = _version(pin, located, environ, install)
    node = _node(pin, located, environ, install) if pin.node is not None else None
    return (there, version) if node is None else (there, version, node)


def _version(pin: Pin, located: Located, environ: Mapping[str, str], install: str) -> Check:
    stated = stated_version(located, environ)
    if stated.version is None:
        return failed("version", f"{pin.binary} --version: {stated.problem}", f"install it anew: {install}")
    if stated.version != pin.version:
        detail = f"{stated.version}; octoform was tried with {pin.version}"
        return unknown("version", detail, f"if it makes trouble: {install}, and no `command` in octopus.yaml")
    return passed("version", f"{stated.version}, the tried one")


def _node(pin: Pin, located: Located, environ: Mapping[str, str], install: str) -> Check | None:
    """The node that the program runs on; None where nothing can be said against the machine's having none."""
    wanted = pin.node or (0, 0)
    version = node_version(located, environ)
    if version is not None and at_least(version, wanted):
        whose = "octoform's own" if located.path else "the machine's"
        return passed("node", f"{version}, {whose}; {dotted(wanted)} or newer is needed")
    detail = f"{version or 'no node'} on PATH; {pin.binary} {pin.version} needs {dotted(wanted)} or newer"
    if located.source == "installed":
        return failed("node", detail, f"{install} brings one")
    return unknown("node", detail, f"if it does not start: {install} brings one")


def sandbox_check(wanted: Sandbox | None, environ: Mapping[str, str]) -> Check:
    """Whether an agent can be confined here as it is wanted; tried out with a program that does nothing."""
    if wanted is None:
        return unknown(
            "sandbox", f"the agent runs without: {sandbox.unconfined(environ, None)}", "write `sandbox: auto`"
        )
    problem = sandbox.available(environ, wanted)
    if problem is None:
        lacks = walls.missing(walls.kernel())
        if lacks:
            return unknown("sandbox", f"can be made, but lacks a wall: {'; '.join(lacks)}", "use a newer kernel")
        return passed("sandbox", "can be made")
    if wanted.required:
        return failed("sandbox", problem.summary, problem.hint)
    return unknown("sandbox", f"the agent runs without: {problem.summary}", problem.hint)


def command_check(program: str, environ: Mapping[str, str]) -> Check:
    """The program of the ``command`` harness."""
    path = shutil.which(program, path=environ.get("PATH"))
    if path is None:
        return failed("program", f"{program} is not there, or not executable", "correct `command` in octopus.yaml")
    return passed("program", str(Path(path)))
