"""Makes scan.ply: what a depth camera would see of an arched sheet on a table.

The camera looks down at the table from 0.85 m above it; its frame is the usual one, z ahead and y
down. Depth has the noise of a consumer camera, some pixels are missing, and some fly between the
sheet's edge and the table.
"""

import math
import random
import struct

WIDTH, HEIGHT, FOV = 160, 120, math.radians(52)
CAMERA, TARGET = (-0.55, 0.05, 0.85), (0.0, 0.0, 0.04)
NEAR, FAR, STEP = 0.3, 1.35, 0.004


def height(x, y):
    """The sheet, 0.34 x 0.44 m, 9 cm high in the middle; beside it the table."""
    if abs(x) < 0.17 and abs(y) < 0.22:
        return 0.02 + 0.07 * math.cos(x / 0.17 * math.pi / 2)
    return 0.0


def unit(v):
    length = math.sqrt(sum(c * c for c in v))
    return [c / length for c in v]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def depth(ray):
    """How far ahead a ray meets the scene: marched until it is under, then halved."""
    far, step = NEAR, STEP
    while step > 1e-5 and far < FAR:
        x, y, z = (c + r * (far + step) for c, r in zip(CAMERA, ray))
        if z > height(x, y):
            far += step
        else:
            step /= 2
    return far


def main():
    random.seed(1)
    ahead = unit([t - c for t, c in zip(TARGET, CAMERA)])
    right = unit(cross(ahead, [0, 0, 1]))
    down = cross(ahead, right)
    scale = math.tan(FOV / 2) / (WIDTH / 2)
    points = []
    for row in range(HEIGHT):
        before = None
        for column in range(WIDTH):
            u, v = (column - WIDTH / 2 + 0.5) * scale, (row - HEIGHT / 2 + 0.5) * scale
            ray = [u * r + v * d + a for r, d, a in zip(right, down, ahead)]
            true = depth(ray)
            seen = true + random.gauss(0, 0.0009) * true**2
            # At a jump of depth a pixel may see both sides at once.
            if before and abs(true - before) > 0.015 and random.random() < 0.3:
                seen = 0.5 * (true + before)
            before = true
            if seen < FAR and random.random() > 0.02:
                points.append((u * seen, v * seen, seen))
    with open("scan.ply", "wb") as file:
        header = ["ply", "format binary_little_endian 1.0", "comment arched sheet, camera frame"]
        header += [f"element vertex {len(points)}"]
        header += [f"property float {axis}" for axis in "xyz"] + ["end_header", ""]
        file.write("\n".join(header).encode())
        for point in points:
            file.write(struct.pack("<3f", *point))
    up = [round(axis[2], 4) for axis in (right, down, ahead)]
    print(f"{len(points)} points; up is {up}, {CAMERA[2]} m above the table")


main()
