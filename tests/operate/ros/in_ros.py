"""Run by a Python that has the real ROS 2: reads messages of a bag, and says what it read.

    in_ros.py REQUEST ANSWER

REQUEST: JSON {"messages": [[type, bytes in base64], ...], "packages": {name: folder with msg/}}; of
a service the bytes are an answer.
ANSWER: JSON {"hashes": {type: hash}, "read": [fields, ...]}.
"""

import base64
import json
import sys
import tempfile
from importlib import import_module
from pathlib import Path

SHARE = Path(sys.prefix) / "share"


def plain(value):
    """Fields of a message, as JSON has them."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value[0]
    if isinstance(value, (str, bool, int, float)):
        return value
    return [plain(one) for one in value]


def installed(kind):
    """The hash of a type that the wheels have."""
    package, what, name = kind.split("/")
    told = json.loads((SHARE / package / what / f"{name}.json").read_text())
    return {one["type_name"]: one["hash_string"] for one in told["type_hashes"]}[kind]


def generated(package, folder):
    """The hashes of a package of .msg files, by ROS's own generator."""
    from rosidl_adapter import convert_to_idl
    from rosidl_generator_type_description import generate_type_hash

    out = Path(tempfile.mkdtemp())
    words = [
        f"{out}:{convert_to_idl(folder, package, file.relative_to(folder), out).relative_to(out)}"
        for file in folder.glob("msg/*.msg")
    ]
    places = [f"{one.name}:{one}" for one in SHARE.iterdir() if (one / "msg").is_dir()]
    asked = {"package_name": package, "output_dir": str(out), "idl_tuples": words}
    (out / "asked.json").write_text(json.dumps(asked | {"include_paths": places}))
    found = {}
    for made in generate_type_hash(str(out / "asked.json")):
        told = json.loads(Path(made).read_text())["type_hashes"]
        found |= {one["type_name"]: one["hash_string"] for one in told}
    return found


def main():
    from rclpy.serialization import deserialize_message

    request = json.loads(Path(sys.argv[1]).read_text())
    hashes, read = {}, []
    for package, folder in request["packages"].items():
        hashes |= generated(package, Path(folder))
    for kind, data in request["messages"]:
        package, what, name = kind.split("/")
        hashes[kind] = installed(kind)
        known = getattr(import_module(f"{package}.{what}"), name)
        known = known.Response if what == "srv" else known
        read.append(plain(deserialize_message(base64.b64decode(data), known)))
    Path(sys.argv[2]).write_text(json.dumps({"hashes": hashes, "read": read}))


if __name__ == "__main__":
    main()
