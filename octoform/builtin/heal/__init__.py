"""What mends one error, by the playbook alone: the action of its class; code is not rewritten."""

from octoform.builtin.heal.stage import run

__all__ = ["run"]
