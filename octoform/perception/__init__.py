"""Pictures of a host's cameras: one picture through the endpoint, judged for what it holds."""
