"""What the schema cannot say, and how it is said: rules on agents, values, scope, and files that are named."""
