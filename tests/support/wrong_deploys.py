"""DEPLOY artifacts that are wrong, each in one way, for a server with its header: a change, the code due."""

from typing import Any

Output = dict[str, Any]
SERVER = '''# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "opencv-python-headless>=4.10,<5", "pyserial~=3.5", "numpy>=1.26,!=2.0.0"]
# ///
"""A camera and a line."""

import cv2
import fastmcp
import numpy
import serial

import runtime


def late() -> None:
    import json

    json.dumps({})
'''
GOOD: Output = {
    "format": 1,
    "status": "ok",
    "python": ">=3.11",
    "requirements": [
        {"name": "fastmcp", "version": "4.1.2", "why": "fastmcp"},
        {"name": "opencv-python-headless", "version": "4.10.0.84", "why": "cv2"},
        {"name": "pyserial", "version": "3.5", "why": "serial"},
        {"name": "numpy", "version": "2.1.0", "why": "numpy"},
    ],
    "imports": [
        {"module": "fastmcp", "provided_by": "fastmcp"},
        {"module": "cv2", "provided_by": "opencv-python-headless"},
        {"module": "serial", "provided_by": "pyserial"},
        {"module": "numpy", "provided_by": "numpy"},
        {"module": "json", "provided_by": "python"},
        {"module": "runtime", "provided_by": "runtime"},
    ],
}


def version(index: int, text: str) -> Any:
    return lambda value: value["requirements"][index].update(version=text)


def requires(name: str, text: str, why: str | None = None) -> Any:
    entry = {"name": name, "version": text, **({"why": why} if why else {})}
    return lambda value: value["requirements"].append(entry)


def imports(module: str, provider: str) -> Any:
    return lambda value: value["imports"].append({"module": module, "provided_by": provider})


def both(*changes: Any) -> Any:
    return lambda value: [change(value) for change in changes]


def provider(index: int, name: str) -> Any:
    return lambda value: value["imports"][index].update(provided_by=name)


def failed(name: str, reason: str = "no wheel for this machine") -> Any:
    return lambda value: value.setdefault("deps_failed", []).append({"name": name, "reason": reason})


OUTSIDE, SCHEMA, TWICE = "DEPLOY-VERSION-OUTSIDE", "DEPLOY-SCHEMA", "DEPLOY-PROVIDER-TWICE"
UNUSED, PROVIDER, LACKS = "DEPLOY-REQUIREMENT-UNUSED", "DEPLOY-IMPORT-PROVIDER", "DEPLOY-IMPORT-UNRESOLVED"
NOT_THERE, LOCAL, PYTHON = "DEPLOY-IMPORT-NOT-THERE", "DEPLOY-VERSION-LOCAL", "DEPLOY-PYTHON-OUTSIDE"
WRONG: dict[str, tuple[Any, str]] = {
    "below the range": (version(0, "4.0.9"), OUTSIDE),
    "above the range": (version(0, "4.2.0"), OUTSIDE),
    "the next major version": (version(1, "5.0.0"), OUTSIDE),
    "beyond a compatible release": (version(2, "4.0"), OUTSIDE),
    "an excluded version": (version(3, "2.0.0"), OUTSIDE),
    "no version at all": (version(3, "2.1.0.x!"), OUTSIDE),
    "a version before the first": (version(3, "1.25.9"), OUTSIDE),
    "a range": (version(0, ">=4.1"), SCHEMA),
    "a wildcard": (version(0, "4.1.*"), SCHEMA),
    "no pin": (lambda value: value["requirements"][0].pop("version"), SCHEMA),
    "a word for a version": (version(0, "latest"), SCHEMA),
    "an address for a name": (requires("https://example.org/x.whl", "1.0", "x"), SCHEMA),
    "a path for a name": (requires("./x.whl", "1.0", "x"), SCHEMA),
    "an address in a version": (version(0, "4.1.2 @ https://example.org/x.whl"), SCHEMA),
    "an extra in a name": (requires("fastmcp[all]", "4.1.2", "x"), SCHEMA),
    "a local version": (version(3, "2.1.0+bench"), LOCAL),
    "a version of a commit": (version(2, "3.5.post1+g1234567"), LOCAL),
    "a version before its release": (version(3, "2.2.0rc1"), "DEPLOY-VERSION-EARLY"),
    "a version of a developer": (version(3, "2.2.0.dev1"), "DEPLOY-VERSION-EARLY"),
    "two packages for one module": (
        both(requires("opencv-python", "4.10.0.84", "windows"), imports("cv2", "opencv-python")),
        TWICE,
    ),
    "two builds of one library": (requires("opencv-python", "4.10.0.84", "windows"), TWICE),
    "two builds, one with more": (requires("opencv-contrib-python-headless", "4.10.0.84", "more codecs"), TWICE),
    "a package that has nothing": (requires("requests", "2.32.0"), UNUSED),
    "a package with an empty reason": (requires("requests", "2.32.0", " "), UNUSED),
    "an import that is not there": (both(requires("requests", "2.32.0"), imports("requests", "requests")), NOT_THERE),
    "an import of another spelling": (imports("pyserial", "pyserial"), NOT_THERE),
    "an import skipped": (lambda value: value["imports"].pop(2), LACKS),
    "a provider that is not required": (provider(2, "serial"), PROVIDER),
    "the standard library for a package": (provider(3, "python"), PROVIDER),
    "the runtime for a package": (provider(1, "runtime"), PROVIDER),
    "a package for the standard library": (provider(4, "numpy"), PROVIDER),
    "a package for the runtime": (provider(5, "fastmcp"), PROVIDER),
    "a package twice": (requires("numpy", "2.1.1", "numpy"), "DEPLOY-DUPLICATE-REQUIREMENT"),
    "a package twice in another spelling": (requires("PySerial", "3.5", "serial"), "DEPLOY-DUPLICATE-REQUIREMENT"),
    "failed and required": (failed("numpy"), "DEPLOY-FAILED-AND-REQUIRED"),
    "declared and not settled": (lambda value: value["requirements"].pop(3), "DEPLOY-DECLARED-NOT-REQUIRED"),
    "an import of what failed, at the top": (
        both(lambda value: value["requirements"].pop(3), failed("numpy")),
        LACKS,
    ),
    "a failure that is told as one": (
        lambda value: value.update(status="error", error="no wheel"),
        "DEPLOY-STATUS-ERROR",
    ),
    "a module of Python skipped": (lambda value: value["imports"].pop(4), LACKS),
    "the runtime skipped": (lambda value: value["imports"].pop(5), LACKS),
    "a newer Python than will serve": (lambda value: value.update(python=">=3.14"), PYTHON),
    "an older Python than will serve": (lambda value: value.update(python="<3.11.7"), PYTHON),
    "a package for a module that is not imported": (requires("scipy", "1.14.1", "scipy"), UNUSED),
    "an older Python alone": (lambda value: value.update(python="<3.10"), PYTHON),
    "no range of Python": (lambda value: value.update(python="three"), PYTHON),
    "a program that is not started": (
        lambda value: value.update(programs=[{"name": "ffmpeg"}]),
        "DEPLOY-PROGRAMS-DIFFER",
    ),
    "a failure of what no one asked for": (failed("torch"), "DEPLOY-FAILED-UNKNOWN"),
}


def _right(value: Output) -> None:
    """What an agent may do, once in each way."""
    value["requirements"][1]["version"] = "4.10.0.84"
    value["requirements"][2]["name"] = "PySerial"
    value["imports"][2]["provided_by"] = "pyserial"
    requires("typing-extensions", "4.12.2", "a version that fastmcp and pydantic agree on")(value)
    imports("pathlib", "python")(value)
    value["conflicts"] = ["opencv-python overwrites the files of opencv-python-headless; the headless one is taken"]
    value["deps_failed"] = []
    value["programs"] = []
    value["python"] = ">=3.11,<4"
    requires("tzdata", "2024.2", "time zones")(value)


RIGHT = _right
