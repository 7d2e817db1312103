"""Profiles: the owner's knowledge of products as prose, used only where its match rule holds. (Heavy: YAML.)"""

from octoform.profiles.model import Profile
from octoform.profiles.profile_parser import load, load_text
from octoform.profiles.selection import (
    briefing,
    commands,
    contributions,
    definition,
    devices_of,
    for_task,
    near,
    packaging,
)

__all__ = [
    "Profile",
    "briefing",
    "commands",
    "contributions",
    "definition",
    "devices_of",
    "for_task",
    "load",
    "load_text",
    "near",
    "packaging",
]
