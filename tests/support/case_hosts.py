"""The hosts on which outputs are held against a contract: the recorded ones, the two rigs, and the bench of `shop`."""

import copy
import functools
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from bench_host import lab, shop
from hosts.plant import plant
from session_folders import session_folder

from octoform.base.id_databases import IdDatabases
from octoform.builtin import scan
from octoform.builtin.identify import identify
from octoform.builtin.probe import probe_root
from octoform.contracts.model import HostScan, ProfileFacts
from octoform.profiles import commands, definition, devices_of, for_task
from octoform.profiles.profile_parser import load
from octoform.simulation import rig as descriptions
from octoform.simulation.rig import Rig
from octoform.simulation.sysfs_tree import Planter

TOP = Path(__file__).parents[2]
SCHEMAS = TOP / "protocol" / "schemas"
RAIL_ANSWER = "a camera rail of the bench, moved by a stepper motor"
_ANSWERS = {"rig": {"usb-2341-804f": RAIL_ANSWER}, "rail": {"usb-2341-804f": RAIL_ANSWER}}
_WITH_PROFILES = ("rig", "rail")


@dataclass(frozen=True)
class Host:
    """One host: its tree, what the embedded agent's PROBE and IDENTIFY say of it, and what octoform itself knows."""

    root: Path
    probe: dict[str, Any]
    identified: dict[str, Any]
    answers: dict[str, str]
    profiles: dict[str, ProfileFacts]
    registered: dict[str, str]


@functools.cache
def host(name: str) -> Host:
    """The host of that name, built once in a folder that goes with the process; ``rig bare`` has no profile."""
    kind, _, bare = name.partition(" ")
    root = _built(kind, _FOLDER / name)
    probe = probe_root(root)
    answers = {} if bare else _ANSWERS.get(kind, {})
    paths = [TOP / "profiles" / f"{each}.md" for each in ("so-arm101", "camera-rail")]
    profiles = load(paths if kind in _WITH_PROFILES and not bare else [])[0]
    held = {each.name: devices_of(each, probe, answers) for each in profiles}
    facts = {
        each.name: ProfileFacts(each.name, held[each.name], each.limits, commands(each), each.product, definition(each))
        for each in profiles
    }
    databases = IdDatabases(root)
    lines = [for_task(each, held[each.name]) for each in profiles]
    registered = {
        device["id"]: " ".join(databases.lookup(device["interface"], device["vid"], device["pid"])).strip()
        for device in probe["devices"]
        if device.get("vid") and device.get("pid")
    }
    return Host(root, probe, identify(probe, databases, lines, answers), answers, facts, registered)


def scan_beside(name: str, value: Any) -> HostScan:
    """What the embedded agent finds beside a PROBE of that host; its own scan is the one that was made with the host.

    That a scan is made each time is for the tests of the stage; hundreds of outputs are of the same few hosts.
    """
    known = host(name)
    with patch.object(scan, "probe", lambda _: copy.deepcopy(known.probe)):
        seen = scan.beside(value, known.root)
    return HostScan(seen["probe"], tuple(seen["unsaid"]), tuple(seen["untrue"]))


_FOLDER = session_folder("case-hosts")


def _built(kind: str, root: Path) -> Path:
    if kind in ("lab", "shop"):
        return (lab if kind == "lab" else shop)(root)
    if kind == "rail":
        Planter(root).plant((TOP / "tests" / "rig" / "rail.host").read_text())
    elif kind == "rig":
        _plugged(root)
    else:
        plant(kind, root)
    return root


def _plugged(root: Path) -> None:
    """What the kernel shows of the reference rig while it runs; nothing answers at its nodes any more."""
    with tempfile.TemporaryDirectory() as live:
        rig = Rig(descriptions.load("reference"), Path(live) / "tree")
        rig.start()
        try:
            shutil.copytree(rig.folder, root, symlinks=True)
        finally:
            rig.stop()
