"""`roco design asyncapi`: the messages of a design as an AsyncAPI 3.0 document, for programs that
draw such documents or generate code from them (asyncapi.com, specification 3.0.0).

A channel of the document is a key of the design: one act from one agent to another in one protocol.
Its sender and its receiver each have an operation on it. The payload is the communicate, with the
contents that the design allows, as JSON schemas; their classes are known where the design is that
of the system here. Zenoh has no AsyncAPI binding: its protocol is only named.
"""

import hashlib
import re
from pathlib import Path
from typing import Annotated, Any

import msgspec

from console.design import files
from console.output import Form, Format, option
from fipa_codec.communicate import Communicate
from fipa_codec.languages import Languages
from operate.system import NoSystemError, here
from topdown.model.design import Design, Rule, load

VERSION, MIME = "3.0.0", "application/msgpack"
SCHEMAS = "#/components/schemas/{name}"
LETTERS = Communicate.__struct_encode_fields__
LETTER = dict(zip(Communicate.__struct_fields__, LETTERS, strict=True))
ROUTER = {
    "host": "{router}",
    "protocol": "zenoh",
    "description": "The router of a run. Agents are linked by mutual TLS.",
    "variables": {"router": {"description": "Where it listens: roco status prints it."}},
}


def asyncapi(
    file: files.File = None,
    to: Annotated[Path | None, option("Write it here; else on standard output.")] = None,
    form: Form = Format.TEXT,
) -> None:
    """Write the messages of a design as an AsyncAPI 3.0 document (JSON).

    Examples:
      roco design asyncapi --to asyncapi.json
      roco design asyncapi design.toml
    """
    with files.problems(form):
        place = files.meant(file)
        design = load(place)
        written = msgspec.json.format(msgspec.json.encode(document(design, _languages(place))))
        if to is None:
            print(written.decode())
            return
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_bytes(written + b"\n")
    count = len(design.rules)
    files.tell({"file": str(to), "channels": count}, form, f"wrote {to}: {count} channels")


def _languages(place: Path) -> Languages | None:
    """The languages of the system here, if this is its design."""
    try:
        system = here()
    except NoSystemError:
        return None
    return system.languages if system.design.place == place.resolve() else None


def document(design: Design, languages: Languages | None = None) -> dict[str, Any]:
    """The AsyncAPI document of a design. `languages`: those of its contents; None: they are only
    named.
    """
    contents, schemas = _schemas(languages)
    channels, operations, messages = {}, {}, {}
    for rule in design.rules.values():
        name = _name(f"{rule.sender}-{rule.receiver}-{rule.protocol}-{rule.performative}")
        messages[name] = _message(rule, name, contents)
        at, said = f"#/channels/{name}", f"#/channels/{name}/messages/{name}"
        channels[name] = {
            "address": design.key_of("{system}", rule),
            "messages": {name: {"$ref": f"#/components/messages/{name}"}},
            "parameters": {"system": {"description": "The name of the running system."}},
        }
        for action, agent in (("send", rule.sender), ("receive", rule.receiver)):
            operations[f"{agent}-{action}s-{name}"] = {
                "action": action,
                "channel": {"$ref": at},
                "messages": [{"$ref": said}],
                "tags": [{"name": agent}],
            }
    system = design.file.system
    return {
        "asyncapi": VERSION,
        "info": {
            "title": system.name,
            # a design has no version: another text is another one
            "version": hashlib.sha256(design.text.encode()).hexdigest()[:12],
            "description": " ".join(system.text.split()),
        },
        "defaultContentType": MIME,
        "servers": {"router": ROUTER},
        "channels": channels,
        "operations": operations,
        "components": {"messages": messages, "schemas": schemas},
    }


def _schemas(languages: Languages | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """The schema of each content class, by language.Class, and all that they refer to, by name."""
    languages = languages or Languages()
    named = {
        f"{name}.{one.__name__}": one
        for name in languages.names
        for one in sorted(languages.named(name).classes, key=lambda one: one.__name__)
    }
    found, schemas = msgspec.json.schema_components(
        [Communicate, *named.values()], ref_template=SCHEMAS
    )
    return (
        dict(zip(named, map(_adapted, found[1:]), strict=True)),
        {_name(name): _adapted(schema) for name, schema in schemas.items()},
    )


def _adapted(schema: Any) -> Any:
    """A schema of msgspec as AsyncAPI has it: without OpenAPI's objects for discriminators, and
    with names of schemas that have no dots.
    """
    if isinstance(schema, list | tuple):
        return [_adapted(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        return {"$ref": SCHEMAS.format(name=_name(schema["$ref"].rpartition("/")[2]))}
    return {
        key: _adapted(value)
        for key, value in schema.items()
        if not (key == "discriminator" and isinstance(value, dict))
    }


def _name(of: str) -> str:
    """A name with the characters that AsyncAPI allows in keys."""
    return re.sub(r"[^\w-]", "_", of)


def _message(rule: Rule, name: str, contents: dict[str, Any]) -> dict[str, Any]:
    """A message of AsyncAPI: a communicate whose fields are those of the rule."""
    fixed = {
        "sender": rule.sender,
        "receiver": rule.receiver,
        "protocol": rule.protocol,
        "performative": str(rule.performative),
    }
    properties: dict[str, Any] = {LETTER[key]: {"const": value} for key, value in fixed.items()}
    if rule.contents:
        allowed = [contents.get(one, {"title": one}) for one in rule.contents]
        properties[LETTER["content"]] = {"anyOf": allowed}
    durable = " It is numbered, journalled and sent again." if rule.durable else ""
    return {
        "name": name,
        "title": f"{rule.performative} from {rule.sender} to {rule.receiver}",
        "summary": f"Channel {rule.channel}, use {rule.use}: at most {rule.bytes} bytes.{durable}",
        "contentType": MIME,
        "payload": {
            "allOf": [{"$ref": SCHEMAS.format(name=Communicate.__name__)}],
            "properties": properties,
        },
    }
