#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes figure.usda: a mannequin with a skeleton (UsdSkel) that stands, strides and waves."""
import math

SEGMENTS = 12

# Joint: parent, place at rest (metres, z up, facing -y).
JOINTS = {
    "hips": (None, (0, 0, 0.95)),
    "spine": ("hips", (0, 0, 1.15)),
    "head": ("spine", (0, 0, 1.52)),
    "arm_l": ("spine", (0.19, 0, 1.42)),
    "fore_l": ("arm_l", (0.47, 0, 1.42)),
    "arm_r": ("spine", (-0.19, 0, 1.42)),
    "fore_r": ("arm_r", (-0.47, 0, 1.42)),
    "leg_l": ("hips", (0.1, 0, 0.92)),
    "shin_l": ("leg_l", (0.1, 0, 0.5)),
    "leg_r": ("hips", (-0.1, 0, 0.92)),
    "shin_r": ("leg_r", (-0.1, 0, 0.5)),
}
NAMES = list(JOINTS)

# Turns by joint in degrees: (axis, angle); seconds.
POSES = {
    0.0: {"arm_l": ("y", 75), "arm_r": ("y", -75), "fore_l": ("y", 8), "fore_r": ("y", -8)},
    1.0: {"arm_l": ("y", 72), "arm_r": ("y", -72), "fore_l": ("z", -60), "fore_r": ("z", 60),
          "leg_l": ("x", -35), "shin_l": ("x", 25), "leg_r": ("x", 30), "shin_r": ("x", 40),
          "spine": ("z", 12)},
    2.0: {"arm_l": ("y", -40), "fore_l": ("y", -70), "arm_r": ("y", -70), "fore_r": ("y", -50),
          "spine": ("y", -8), "head": ("y", 10)},
}


def full_path(name):
    parent = JOINTS[name][0]
    return name if parent is None else full_path(parent) + "/" + name


def text(values, digits=4):
    return "(" + ", ".join(f"{round(v, digits) + 0.0:g}" for v in values) + ")"


def tube(points, faces, weights, line, radii, joints, flat=(1.0, 1.0)):
    """Rings along `line` (at least two points); the joint changes where the line passes it."""
    first = len(points)
    for index, (place, radius) in enumerate(zip(line, radii)):
        a = line[max(index - 1, 0)]
        b = line[min(index + 1, len(line) - 1)]
        along = [y - x for x, y in zip(a, b)]
        length = math.sqrt(sum(x * x for x in along)) or 1.0
        along = [x / length for x in along]
        side = (0, 1, 0) if abs(along[1]) < 0.7 else (1, 0, 0)
        up = (along[1] * side[2] - along[2] * side[1], along[2] * side[0] - along[0] * side[2],
              along[0] * side[1] - along[1] * side[0])
        for k in range(SEGMENTS):
            turn = 2 * math.pi * k / SEGMENTS
            c, s = math.cos(turn) * radius * flat[0], math.sin(turn) * radius * flat[1]
            points.append(tuple(p + c * u + s * v for p, u, v in zip(place, up, side)))
            weights.append(joints(index / (len(line) - 1)))
    for ring in range(len(line) - 1):
        for k in range(SEGMENTS):
            a = first + ring * SEGMENTS + k
            b = first + ring * SEGMENTS + (k + 1) % SEGMENTS
            faces.append((a, b, b + SEGMENTS, a + SEGMENTS))
    for ring, order in ((0, -1), (len(line) - 1, 1)):
        corners = [first + ring * SEGMENTS + k for k in range(SEGMENTS)]
        faces.append(tuple(corners[::order]))


def between(a, b, middle, width):
    """Joint `a`, and from `middle` on joint `b`, blended over `width`."""
    def joints(share):
        t = min(max((share - middle) / width + 0.5, 0.0), 1.0)
        t = t * t * (3 - 2 * t)
        return ((NAMES.index(a), 1 - t), (NAMES.index(b), t))
    return joints


def limb(start, end, thick, thin, count=11):
    line, radii = [], []
    for i in range(count):
        t = i / (count - 1)
        line.append(tuple(x + t * (y - x) for x, y in zip(start, end)))
        radius = thick + t * (thin - thick)
        # Round ends.
        radii.append(radius * (0.55 if i in (0, count - 1) else 1.0))
    return line, radii


def main():
    points, faces, weights = [], [], []
    for side, x in (("l", 1), ("r", -1)):
        tube(points, faces, weights, *limb((0.15 * x, 0, 1.42), (0.78 * x, 0, 1.42), 0.062, 0.036),
             between("arm_" + side, "fore_" + side, 0.51, 0.3))
        tube(points, faces, weights, *limb((0.1 * x, 0, 0.96), (0.1 * x, 0, 0.03), 0.088, 0.05),
             between("leg_" + side, "shin_" + side, 0.49, 0.25))
        tube(points, faces, weights,
             *limb((0.1 * x, 0.05, 0.04), (0.1 * x, -0.2, 0.035), 0.045, 0.04, 4),
             between("shin_" + side, "shin_" + side, 0.5, 0.1))
    torso = [(0, 0, z) for z in (0.88, 0.93, 1.0, 1.08, 1.16, 1.25, 1.34, 1.42, 1.47, 1.5)]
    tube(points, faces, weights, torso,
         [0.10, 0.155, 0.16, 0.145, 0.14, 0.155, 0.175, 0.17, 0.11, 0.055],
         between("hips", "spine", 0.4, 0.5), (1.0, 0.68))
    head = [(0, 0, 1.48 + 0.28 * i / 8) for i in range(9)]
    tube(points, faces, weights, head,
         [0.05, 0.055, 0.085, 0.1, 0.105, 0.105, 0.095, 0.07, 0.02],
         between("head", "head", 0.5, 0.1), (0.9, 1.05))

    bind = {name: place for name, (parent, place) in JOINTS.items()}

    def matrix(x, y, z):
        return f"((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), ({x:g}, {y:g}, {z:g}, 1))"

    def local(name):
        parent, place = JOINTS[name]
        base = bind[parent] if parent else (0, 0, 0)
        return tuple(round(p - q, 6) for p, q in zip(place, base))

    def quaternion(turn):
        if turn is None:
            return "(1, 0, 0, 0)"
        axis, degrees = turn
        half = math.radians(degrees) / 2
        parts = [math.sin(half) if axis == name else 0 for name in "xyz"]
        return text([math.cos(half)] + parts, 6)

    joint_names = ", ".join(f'"{full_path(name)}"' for name in NAMES)
    rotations = ",\n".join(
        f"                {24 * seconds:g}: ["
        + ", ".join(quaternion(pose.get(name)) for name in NAMES) + "]"
        for seconds, pose in POSES.items())
    indices = ", ".join(f"{a}, {b}" for (a, _), (b, _) in weights)
    shares = ", ".join(f"{round(a, 3):g}, {round(1 - round(a, 3), 3):g}"
                       for (_, a), (_, b) in weights)
    print(f'''#usda 1.0
(
    doc = """Written by make_figure.py. SPDX-License-Identifier: Apache-2.0"""
    defaultPrim = "Figure"
    metersPerUnit = 1
    upAxis = "Z"
    startTimeCode = 0
    endTimeCode = {24 * max(POSES):g}
    timeCodesPerSecond = 24
)

def SkelRoot "Figure" (
    prepend apiSchemas = ["SkelBindingAPI"]
)
{{
    rel skel:skeleton = </Figure/Bones>

    def Skeleton "Bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token[] joints = [{joint_names}]
        uniform matrix4d[] bindTransforms = [{", ".join(matrix(*bind[n]) for n in NAMES)}]
        uniform matrix4d[] restTransforms = [{", ".join(matrix(*local(n)) for n in NAMES)}]
        rel skel:animationSource = </Figure/Bones/Moves>

        def SkelAnimation "Moves"
        {{
            uniform token[] joints = [{joint_names}]
            float3[] translations = [{", ".join(text(local(n)) for n in NAMES)}]
            half3[] scales = [{", ".join("(1, 1, 1)" for _ in NAMES)}]
            quatf[] rotations.timeSamples = {{
{rotations}
            }}
        }}
    }}

    def Mesh "Body" (
        prepend apiSchemas = ["SkelBindingAPI"]
    )
    {{
        uniform token subdivisionScheme = "catmullClark"
        color3f[] primvars:displayColor = [(0.62, 0.42, 0.26)]
        int[] faceVertexCounts = [{", ".join(str(len(f)) for f in faces)}]
        int[] faceVertexIndices = [{", ".join(str(i) for f in faces for i in f)}]
        point3f[] points = [{", ".join(text(p) for p in points)}]
        int[] primvars:skel:jointIndices = [{indices}] (
            elementSize = 2
            interpolation = "vertex"
        )
        float[] primvars:skel:jointWeights = [{shares}] (
            elementSize = 2
            interpolation = "vertex"
        )
    }}
}}''')


main()
