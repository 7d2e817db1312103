"""PROBE of the embedded agent: lists what a Linux kernel shows in text files; opens no device, judges nothing."""

from octoform.builtin.probe.stage import run

__all__ = ["run"]
