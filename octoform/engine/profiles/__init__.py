"""Profiles for their owner: a draft from what was found, and where one matches."""
