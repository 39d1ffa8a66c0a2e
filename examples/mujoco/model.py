"""A MuJoCo model of one arm, generated from a plan file's robot: the chain of our URDF.

The URDF holds shapes and limits but no masses: those below are the PR2's, rounded, spread evenly
over each link's shapes. The arm's counterbalance is gravity compensation.
"""

import math
import xml.etree.ElementTree as ET

# [kg], by the end of the link's name.
MASSES = {
    "shoulder_pan_link": 16.0,
    "shoulder_lift_link": 2.8,
    "upper_arm_roll_link": 1.0,
    "upper_arm_link": 5.0,
    "elbow_flex_link": 1.9,
    "forearm_roll_link": 0.5,
    "forearm_link": 2.0,
    "wrist_flex_link": 0.6,
    "wrist_roll_link": 0.3,
    "gripper_palm_link": 0.6,
    "gripper_fingers_link": 0.3,
}
# Gains of the PR2's joint controllers: p [N·m/rad], d [N·m·s/rad]; the bound on effort is the
# URDF's. Armature is the motor's inertia at the joint [kg·m²], damping is viscous [N·m·s/rad].
JOINTS = {
    "shoulder_pan_joint": (2400.0, 18.0, 0.5, 10.0),
    "shoulder_lift_joint": (1200.0, 10.0, 0.4, 10.0),
    "upper_arm_roll_joint": (1000.0, 6.0, 0.15, 0.1),
    "elbow_flex_joint": (700.0, 4.0, 0.15, 1.0),
    "forearm_roll_joint": (300.0, 6.0, 0.03, 0.1),
    "wrist_flex_joint": (300.0, 4.0, 0.02, 0.1),
    "wrist_roll_joint": (300.0, 4.0, 0.02, 0.1),
}


def _table(values, name):
    return next((v for end, v in values.items() if name.endswith("_" + end)), None)


def _numbers(text, default="0 0 0"):
    return [float(v) for v in (text or default).split()]


def _quaternion(rpy):
    """Of roll, pitch, yaw about fixed axes: w x y z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in rpy)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def _pose(origin):
    xyz = _numbers(origin.get("xyz") if origin is not None else None)
    rpy = _numbers(origin.get("rpy") if origin is not None else None)
    text = lambda values: " ".join(repr(v) for v in values)
    return {"pos": text(xyz), "quat": text(_quaternion(rpy))}


def _shapes(body, link):
    shapes = link.findall("collision")
    mass = _table(MASSES, link.get("name"))
    for shape in shapes:
        kind = shape.find("geometry")[0]
        if kind.tag == "box":
            size = [0.5 * v for v in _numbers(kind.get("size"))]
        else:
            size = [float(kind.get("radius")), 0.5 * float(kind.get("length"))]
        geom = ET.SubElement(body, "geom", type=kind.tag, size=" ".join(map(repr, size)),
                             contype="0", conaffinity="0", **_pose(shape.find("origin")))
        geom.set("mass", repr((mass or 1.0) / len(shapes)))


def mjcf(urdf, joints, held):
    """MJCF text of the arm with these joints; all others stand where `held` says."""
    robot = ET.parse(urdf).getroot()
    links = {link.get("name"): link for link in robot.findall("link")}
    by_parent = {}
    for joint in robot.findall("joint"):
        by_parent.setdefault(joint.find("parent").get("link"), []).append(joint)
    children = {j.find("child").get("link") for j in robot.findall("joint")}
    root = next(name for name in links if name not in children)

    model = ET.Element("mujoco", model="arm")
    ET.SubElement(model, "option", timestep="0.001", integrator="implicitfast")
    ET.SubElement(model, "compiler", angle="radian", autolimits="true")
    world = ET.SubElement(model, "worldbody")
    actuators = ET.SubElement(model, "actuator")

    def leads_to_arm(link):
        return any(
            joint.get("name") in joints or leads_to_arm(joint.find("child").get("link"))
            for joint in by_parent.get(link, [])
        )

    def grow(parent, link, moving):
        for joint in by_parent.get(link, []):
            name, child = joint.get("name"), joint.find("child").get("link")
            own = name in joints
            if not (moving or own or leads_to_arm(child)):
                continue
            body = ET.SubElement(parent, "body", name=child, gravcomp="1",
                                 **_pose(joint.find("origin")))
            if own:
                _, _, armature, damping = _table(JOINTS, name)
                limit = joint.find("limit")
                attributes = {}
                if limit.get("lower") is not None:
                    attributes["range"] = limit.get("lower") + " " + limit.get("upper")
                ET.SubElement(body, "joint", name=name, axis=joint.find("axis").get("xyz"),
                              armature=repr(armature), damping=repr(damping), **attributes)
                effort = float(limit.get("effort"))
                ET.SubElement(actuators, "motor", name=name, joint=name,
                              ctrlrange=f"{-effort} {effort}")
            elif joint.get("type") == "prismatic" and name in held:
                axis = _numbers(joint.find("axis").get("xyz"))
                pos = [float(p) + held[name] * a for p, a in zip(body.get("pos").split(), axis)]
                body.set("pos", " ".join(map(repr, pos)))
            if own or moving:
                _shapes(body, links[child])
            grow(body, child, own or moving)

    grow(world, root, False)
    return ET.tostring(model, encoding="unicode")


def gains(joints):
    """p and d of each joint."""
    rows = [_table(JOINTS, name) for name in joints]
    return [r[0] for r in rows], [r[1] for r in rows]
