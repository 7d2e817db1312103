"""Profiles: the owner's knowledge of products as prose, used only where its evidence rule holds. (Heavy: YAML.)"""

from octoform.profiles.applying import briefing, holds
from octoform.profiles.model import Profile
from octoform.profiles.reading import load

__all__ = ["Profile", "briefing", "holds", "load"]
