"""Writes ``petzval/requests.py``: the requests of all jobs as typed dictionaries, from their JSON Schemas.

    python write_requests.py          # writes the file
    python write_requests.py --check  # exit code 1 if it would change
"""

from __future__ import annotations

import keyword
import sys
import textwrap
from pathlib import Path
from typing import Any

import petzval.jobs

HEADER = '''"""The requests of all jobs as typed dictionaries, by the name of the job: ``lens-tolerance`` is `LensTolerance`.

Every key may be left out but those that a job says it needs. `write_requests.py` writes this file from the schemas of the jobs.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict

'''

TARGET = Path(__file__).parent / "python" / "petzval" / "requests.py"


def camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.replace("_", "-").split("-"))


class Module:
    """The classes that are written so far, by name."""

    def __init__(self) -> None:
        self.classes: dict[str, str] = {}

    def type_of(self, schema: Any, definitions: dict[str, Any], owner: str) -> str:
        """The type of a value, as text."""
        if not isinstance(schema, dict):
            return "Any"
        if "$ref" in schema:
            name = schema["$ref"].rsplit("/", 1)[-1]
            return self.type_of(definitions[name], definitions, owner + name)
        if "const" in schema:
            return f"Literal[{schema['const']!r}]"
        if "enum" in schema:
            return f"Literal[{', '.join(repr(value) for value in schema['enum'])}]"
        for key in ("anyOf", "oneOf"):
            if key in schema:
                parts = [self.type_of(part, definitions, f"{owner}{i}") for i, part in enumerate(schema[key], 1)]
                return " | ".join(dict.fromkeys(parts))
        kind = schema.get("type")
        if isinstance(kind, list):
            parts = [self.type_of({**schema, "type": one}, definitions, owner) for one in kind]
            return " | ".join(dict.fromkeys(parts))
        match kind:
            case "string":
                return "str"
            case "integer":
                return "int"
            case "number":
                return "float"
            case "boolean":
                return "bool"
            case "null":
                return "None"
            case "array":
                return f"list[{self.type_of(schema.get('items', {}), definitions, owner + 'Item')}]"
            case "object" if "properties" in schema:
                self.write(owner, schema, definitions)
                return f'"{owner}"'
            case "object":
                return f"dict[str, {self.type_of(schema.get('additionalProperties', {}), definitions, owner + 'Value')}]"
        return "Any"

    def write(self, name: str, schema: dict[str, Any], definitions: dict[str, Any]) -> None:
        """Writes the class of an object."""
        if name in self.classes:
            return
        self.classes[name] = ""
        needs = schema.get("required", [])
        keys = schema.get("properties", {})
        lines = [docstring(schema.get("description", ""), needs)]
        plain = True
        for key, value in keys.items():
            plain = plain and key.isidentifier() and not keyword.iskeyword(key)
            lines.append(f"    {key}: {self.type_of(value, definitions, name + camel(key))}")
            if about := value.get("description", ""):
                lines.append(indented(about))
        text = "\n".join(lines)
        if not plain:
            fields = ", ".join(f"{key!r}: Any" for key in keys)
            self.classes[name] = f"{name} = TypedDict({name!r}, {{{fields}}}, total=False)\n"
            return
        self.classes[name] = f"class {name}(TypedDict, total=False):\n{text}\n"


def plain(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"""', "'''").replace("[`", "`").replace("`]", "`")


def docstring(about: str, needs: list[str]) -> str:
    parts = [about or "A part of a request."]
    if needs:
        parts.append("Needs " + ", ".join(f"`{key}`" for key in needs) + ".")
    return indented("\n\n".join(parts))


def indented(about: str) -> str:
    paragraphs = [textwrap.fill(" ".join(part.split()), 110, break_long_words=False) for part in plain(about).split("\n\n")]
    text = "\n\n".join(paragraphs)
    if text.endswith('"'):
        text += " "
    return textwrap.indent(f'"""{text}"""', "    ")


def module() -> str:
    """The text of ``requests.py``."""
    found = Module()
    for name in petzval.jobs.names():
        request, _ = petzval.jobs.schema(name)
        found.write(camel(name), request, request.get("$defs", {}))
    names = ", ".join(repr(name) for name in petzval.jobs.names())
    return HEADER + f"JobName = Literal[{names}]\n" + '"""Every job."""\n\n\n' + "\n\n".join(found.classes.values())


if __name__ == "__main__":
    text = module()
    if "--check" in sys.argv:
        sys.exit(0 if TARGET.read_text(encoding="utf-8") == text else f"{TARGET} is not what the schemas say; run {sys.argv[0]}")
    TARGET.write_text(text, encoding="utf-8")
