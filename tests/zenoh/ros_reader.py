"""Run as a process of its own: zenoh-ros2-sdk reads topics of a node, with types of a folder.

    ros_reader.py FOLDER PORT

FOLDER: <package>/msg/<Name>.msg. It prints a JSON object a line: {"topics": {name: [types]}}, then
{"topic": name, ...fields} for each message.
"""

import json
import sys

from zenoh_ros2_sdk import ROS2Subscriber, get_registry, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

WANTED = {
    "/joint_states": ("sensor_msgs/msg/JointState", lambda one: {"position": [*one.position]}),
    "/robot_description": ("std_msgs/msg/String", lambda one: {"data": one.data}),
    "/communicates/C3": (
        "fipa_msgs/msg/Communicate",
        lambda one: {"sender": one.sender, "performative": one.performative},
    ),
}


def main(folder: str, port: str) -> None:
    get_registry(folder)
    at = {"router_ip": "127.0.0.1", "router_port": int(port)}
    topics = {name: [*kinds] for name, kinds in get_topic_names_and_types(**at)}
    print(json.dumps({"topics": topics}), flush=True)
    kept = []
    for topic, (kind, told) in WANTED.items():

        def heard(one, topic=topic, told=told):
            print(json.dumps({"topic": topic} | told(one)), flush=True)

        latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL)
        qos = latched if topic == "/robot_description" else None
        kept.append(ROS2Subscriber(topic, kind, heard, qos=qos, **at))
    print(json.dumps({"ready": True}), flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main(*sys.argv[1:])
