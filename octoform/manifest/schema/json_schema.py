"""The JSON Schema of the manifest, for editors and for ``octoform schema``. (Heavy: pydantic.)

Made of the models that `loading` checks against, so it can never promise a setting that octoform refuses.
"""

import json
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from octoform.manifest.schema.document import Document

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Generator(GenerateJsonSchema):
    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """A key is given or left out; an empty one is refused, so null is no value of any setting."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Defaults are shown where they mean something: not null, and not a table of defaults."""
        inner: JsonSchemaValue = self.generate_inner(schema["schema"])
        default = schema.get("default")
        if default is None or not isinstance(default, str | int | list):
            return inner
        return {"allOf": [inner], "default": default} if "$ref" in inner else {**inner, "default": default}


def json_schema() -> dict[str, Any]:
    """The schema as JSON data, in the dialect that `DIALECT` names."""
    body = Document.model_json_schema(schema_generator=_Generator)
    for table in (body, *body["$defs"].values()):
        for setting in table.get("properties", {}).values():
            setting.pop("title", None)  # it would only repeat the key
    head = {"$schema": DIALECT, "title": "octopus.yaml"}
    return {**head, **{key: value for key, value in body.items() if key != "title"}}


def text() -> str:
    """The schema as it is printed and kept beside the other schemas."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"
