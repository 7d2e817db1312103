"""Rules for the code of a generated server, read from its syntax tree."""
