"""Products of quaternions in plain numbers, w first: numpy takes much longer for so few."""

Quat = tuple[float, float, float, float]


def product(a: Quat, b: Quat) -> Quat:
    """The Hamilton product: the turn b, then the turn a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(quat_wxyz: Quat) -> Quat:
    """The inverse of a turn."""
    w, x, y, z = quat_wxyz
    return w, -x, -y, -z
