"""Commands on octoform itself: help, version, completion."""
