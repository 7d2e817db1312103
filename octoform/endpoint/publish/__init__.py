"""What goes into service: the spec of the endpoint, its policy, its files, and taking them away."""
