"""What ought to report, and what does: health needs it, and an agent is told of it."""
