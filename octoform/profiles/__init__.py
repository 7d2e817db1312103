"""Profiles: the owner's knowledge of products as prose, used only where its evidence rule holds. (Heavy: YAML.)"""

from octoform.profiles.applying import briefing, commands, contributions, for_task, holds, near
from octoform.profiles.model import Profile
from octoform.profiles.reading import load, load_text

__all__ = ["Profile", "briefing", "commands", "contributions", "for_task", "holds", "load", "load_text", "near"]
