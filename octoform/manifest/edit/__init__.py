"""A person's octopus.yaml written: the first one, and one setting with comments and order kept."""
