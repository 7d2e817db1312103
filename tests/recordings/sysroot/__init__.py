"""From a recording of a host (a text, a tar, an export) to a folder that stands in for that host's file system."""
