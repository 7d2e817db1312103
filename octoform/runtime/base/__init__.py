"""Rules that octoform's core applies too: each module here is a link to a file of its base.

The copy beside a server holds the text of these files, so it needs nothing of octoform.
"""
