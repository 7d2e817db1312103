"""What the code of a generated server may do, read from its syntax tree."""
