#!/usr/bin/env python3
"""Rooms on both sides of a hall, a door to it and a window each, as an .obj of large quads, to be cut by --max-edge.
Usage: made_building.py ROOMS_A_SIDE OUT.obj"""
import sys

rooms, path = int(sys.argv[1]), sys.argv[2]
side, height, wall, hall = 4.0, 3.0, 0.2, 2.4
points, faces = [], []


def quad(a, b, c, d):
    """Its front is where a, b, c, d turn counter-clockwise."""
    faces.append(range(len(points) + 1, len(points) + 5))
    points.extend((a, b, c, d))


def upright(along, at, begin, end, front, holes=()):
    """A wall along x (0) or z (2) at a place of the other axis, its front towards `front` (1, -1), around holes (begin,
    end, sill, top)."""
    def piece(u0, u1, v0, v1):
        if u1 - u0 < 1e-6 or v1 - v0 < 1e-6:
            return
        corners = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
        if (front > 0) != (along == 0):
            corners.reverse()
        quad(*[(u, v, at) if along == 0 else (at, v, u) for u, v in corners])

    for h0, h1, sill, top in sorted(holes):
        piece(begin, h0, 0, height)
        piece(h0, h1, 0, sill)
        piece(h0, h1, top, height)
        begin = h1
    piece(begin, end, 0, height)


def level(x0, x1, z0, z1):
    quad((x0, 0, z0), (x0, 0, z1), (x1, 0, z1), (x1, 0, z0))
    quad((x0, height, z0), (x1, height, z0), (x1, height, z1), (x0, height, z1))


length = rooms * (side + wall) - wall
doors = []
for i in range(rooms):
    x0 = i * (side + wall)
    door, window = (x0 + 1.5, x0 + 2.4, 0, 2.1), (x0 + 1, x0 + 3, 0.9, 2.2)
    doors.append(door)
    for sign in (-1, 1):
        near, far = sign * (hall / 2 + wall), sign * (hall / 2 + wall + side)
        level(x0, x0 + side, min(near, far), max(near, far))
        upright(0, near, x0, x0 + side, sign, [door])
        upright(0, far, x0, x0 + side, -sign, [window])
        upright(2, x0, min(near, far), max(near, far), 1)
        upright(2, x0 + side, min(near, far), max(near, far), -1)
        z0, z1 = sorted((sign * hall / 2, near))
        upright(2, door[0], z0, z1, 1)
        upright(2, door[1], z0, z1, -1)
        quad((door[0], 0, z0), (door[0], 0, z1), (door[1], 0, z1), (door[1], 0, z0))
level(0, length, -hall / 2, hall / 2)
for sign in (-1, 1):
    upright(0, sign * hall / 2, 0, length, -sign, doors)
    upright(2, (0, length)[sign > 0], -hall / 2, hall / 2, -sign, [(-0.6, 0.6, 0, 2.1)] if sign < 0 else [])
with open(path, "w") as f:
    f.writelines("v %g %g %g\n" % p for p in points)
    f.writelines("f " + " ".join(map(str, q)) + "\n" for q in faces)
