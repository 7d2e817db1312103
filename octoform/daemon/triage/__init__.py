"""Triage: what is wrong, judged from facts by rules alone; no agent is asked, nothing is opened and no clock read."""

from octoform.daemon.triage.classify import judge
from octoform.daemon.triage.failure_history import Recall, remember

__all__ = ["Recall", "judge", "remember"]
