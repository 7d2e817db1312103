"""What is before each call of a tool: its registration, validation, elicitation, and what is answered."""
