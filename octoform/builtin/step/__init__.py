"""A privileged step: what is to be tried so that the tools of a device prove themselves, from the profile's grammar."""

from octoform.builtin.step.stage import run

__all__ = ["run"]
