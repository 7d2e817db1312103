"""What the cameras of a host show: one picture through the endpoint, judged for what it holds."""
