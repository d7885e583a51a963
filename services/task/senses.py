"""Words for faulty sensors."""

from companion.languages import rc

_WRONG = {
    rc.Fault.NO_NUMBER: "reads what is no number",
    rc.Fault.ZERO: "reads zero",
    rc.Fault.STUCK: "reads the same while the hand turns",
    rc.Fault.FROZEN: "shows the same picture again",
    rc.Fault.DARK: "shows a dark picture",
    rc.Fault.UNIFORM: "shows one brightness everywhere",
    rc.Fault.MIRRORED: "shows a mirrored picture",
    rc.Fault.BLIND: "shows nothing of the furniture before it",
    rc.Fault.OFF: "off by {off:.3f} rad",
}
_SENSES = {
    rc.Sensor.RIGHT_WRIST: "the right wrist does not feel: its sensor {wrong}",
    rc.Sensor.LEFT_WRIST: "the left wrist does not feel: its sensor {wrong}",
    rc.Sensor.CAMERA: "the camera does not see: it {wrong}",
    rc.Sensor.NECK: "torso or head is measured {wrong}: all furniture in view has turned",
    rc.Sensor.RIGHT_ARM: "the right arm is measured {wrong}, or its grip slipped",
    rc.Sensor.LEFT_ARM: "the left arm is measured {wrong}, or its grip slipped",
}


def told(outcome: rc.Done | rc.NotDone) -> str:
    """Return which sensors are faulty, and how; "" for none."""
    return "; ".join(_SENSES[one.sense].format(wrong=_WRONG[one.fault].format(off=one.off)) for one in outcome.ill)
