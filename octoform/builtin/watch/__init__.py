"""How a deployment is, told by rules alone: the class of an error from the kind of the exception and its words."""

from octoform.builtin.watch.stage import run

__all__ = ["run"]
