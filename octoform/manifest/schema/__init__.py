"""The manifest as it is written: the models that are checked against and that the JSON Schema is made of."""
