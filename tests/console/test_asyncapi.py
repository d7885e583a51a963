"""The AsyncAPI document of a design, read by others and compared with recorded traffic."""

import copy
import json
import warnings
from importlib import resources
from pathlib import Path

import jsonschema
import msgspec
import pytest

from companion.design import LANGUAGES
from companion.tools.system import SYSTEM
from console.design.asyncapi import document
from operate.recording import mcap_file
from operate.recording.records import Spoken
from topdown.model.design import load

with warnings.catch_warnings():  # its models have a field "schema"
    warnings.simplefilter("ignore", UserWarning)
    from asyncapi3 import AsyncAPI3

ROOT = Path(__file__).parents[2]
POUR = ROOT / "tests/histories/pour_seed_7/traffic.mcap"
DEPOT = load(ROOT / "examples/depot/depot/design.toml")


@pytest.mark.parametrize(
    ("design", "languages"), [(SYSTEM.design, LANGUAGES), (DEPOT, None)], ids=["pour", "depot"]
)
def test_another_program_reads_it(design, languages):
    """As many channels as the design has rules, each with an operation at both ends."""
    written = msgspec.json.decode(msgspec.json.encode(document(design, languages)))
    read = AsyncAPI3.model_validate(written)
    assert len(read.channels.root) == len(design.rules)
    of = {(one.action, one.tags[0].name) for one in read.operations.root.values()}
    ends = {("send", rule.sender) for rule in design.rules.values()}
    assert of == ends | {("receive", rule.receiver) for rule in design.rules.values()}
    addresses = {
        channel.address.replace("{system}", "s") for channel in read.channels.root.values()
    }
    assert addresses == {design.key_of("s", rule) for rule in design.rules.values()}


@pytest.mark.parametrize(
    ("design", "languages"), [(SYSTEM.design, LANGUAGES), (DEPOT, None)], ids=["pour", "depot"]
)
def test_the_official_schema_accepts_it(design, languages):
    """That of the AsyncAPI initiative, of which xstate-statemachine has a copy; and it refuses a
    document with a slip.
    """
    schema = json.loads(
        resources.files("xstate_statemachine.eda").joinpath("_asyncapi_schema.json").read_text()
    )
    assert schema["$id"] == "http://asyncapi.com/definitions/3.0.0/asyncapi.json"
    check = jsonschema.Draft7Validator(schema)
    written = msgspec.json.decode(msgspec.json.encode(document(design, languages)))
    assert not [error.message for error in check.iter_errors(written)]
    next(iter(written["operations"].values()))["action"] = "sing"
    assert not check.is_valid(written)


def test_what_was_said_fits_the_payload_of_its_channel():
    """And not that of a channel of other agents, nor with another content."""
    written = msgspec.json.decode(msgspec.json.encode(document(SYSTEM.design, LANGUAGES)))
    payloads = {
        channel["address"]: written["components"]["messages"][name]["payload"]
        for name, channel in written["channels"].items()
    }
    checks = {
        address: jsonschema.Draft202012Validator({**one, "components": written["components"]})
        for address, one in payloads.items()
    }
    records = mcap_file.read(POUR, SYSTEM).records
    said = [one for one in records if isinstance(one, Spoken) and not one.lost]
    seen = set()
    for one in said:
        address = SYSTEM.design.key("{system}", one.communicate)
        if address in seen:
            continue
        seen.add(address)
        plain = msgspec.msgpack.decode(one.wire)
        assert not [error.message for error in checks[address].iter_errors(plain)], address
        wrong = {**copy.deepcopy(plain), "s": "nobody"}
        assert [*checks[address].iter_errors(wrong)]
        if "Z" in plain:
            assert [*checks[address].iter_errors({**plain, "Z": {"type": "Nothing"}})]
    assert len(seen) > 15
