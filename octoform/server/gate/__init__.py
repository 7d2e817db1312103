"""The gate before each call of a tool: registration, validation, elicitation, and the answer."""
