"""JSON Schemas: held against values, and compared for what they accept."""
