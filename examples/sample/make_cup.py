#!/usr/bin/env python3
"""Writes cup.obj: a cup of 9 cm across and 11 cm high, put upside down on z = 0."""

from math import cos, pi, sin
from pathlib import Path

SIDES = 48
# Its outline up to the foot, which is on top: distance from the axis and height. [m]
OUTLINE = [(0.045, 0.0), (0.043, 0.060), (0.036, 0.110)]


def main() -> None:
    rings = [[(r * cos(2 * pi * k / SIDES), r * sin(2 * pi * k / SIDES), z) for k in range(SIDES)]
             for r, z in OUTLINE]
    points = [point for ring in rings for point in ring] + [(0.0, 0.0, 0.0), (0.0, 0.0, OUTLINE[-1][1])]
    below, above = len(points) - 1, len(points)
    faces = []
    for k in range(SIDES):
        after = (k + 1) % SIDES
        for ring in range(len(rings) - 1):
            a, b = ring * SIDES + k + 1, ring * SIDES + after + 1
            faces.append((a, b, b + SIDES, a + SIDES))
        faces.append((below, after + 1, k + 1))
        last = (len(rings) - 1) * SIDES + 1
        faces.append((above, last + k, last + after))
    lines = ["# Made by make_cup.py. [m]"]
    lines += ["v " + " ".join(f"{x:.5f}" for x in point) for point in points]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    Path(__file__).with_name("cup.obj").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
