"""Pictures of surfaces and tools without a display, drawn by numpy alone; PNG files of them.

Equal inputs give equal pictures. A graphics card draws more (`trocar-client --replay --headless`)."""

import struct
import zlib

import numpy as np

TISSUE, WOUND, STEEL, GROUND = (204, 121, 110), (150, 40, 40), (150, 155, 165), (24, 28, 36)
MOST_SIDE = 2048  # pixels


def _unit(vector):
    return vector / np.linalg.norm(vector)


def rod(pose, radius, length=0.15, sides=8):
    """A tool as triangles: positions, m, float64 (vertices x 3), and numbers, int64 (triangles x 3).

    `pose`: 7 numbers as Session.pose() has them. The rod has a pointed end of one radius at the tip."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(sides, radius)], axis=1)
    local = np.concatenate([[[0, 0, 0]], ring, ring + [0, 0, length], [[0, 0, radius + length]]])
    near, far = 1 + np.arange(sides), 1 + sides + np.arange(sides)
    near_next, far_next = np.roll(near, -1), np.roll(far, -1)
    tip, end = np.zeros(sides, int), np.full(sides, 2 * sides + 1)
    triangles = np.concatenate([np.stack(corners, axis=1) for corners in (
        (tip, near_next, near), (near, near_next, far_next), (near, far_next, far), (end, far, far_next))])
    x, y, z, w = np.asarray(pose, float)[3:]
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return local @ turn.T + np.asarray(pose, float)[:3], triangles


def _fragments(u, v, width, height):
    """Pixels whose middle lies in a triangle: triangle numbers, x, y, and weights of the corners.

    `u`, `v`: places in the picture (triangles x 3)."""
    low_x = np.clip(np.ceil(u.min(axis=1) - 0.5), 0, width).astype(int)
    low_y = np.clip(np.ceil(v.min(axis=1) - 0.5), 0, height).astype(int)
    wide = np.clip(np.floor(u.max(axis=1) - 0.5).astype(int) + 1, 0, width) - low_x
    high = np.clip(np.floor(v.max(axis=1) - 0.5).astype(int) + 1, 0, height) - low_y
    counts = np.maximum(wide, 0) * np.maximum(high, 0)
    which = np.repeat(np.arange(len(u)), counts)
    place = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    x, y = low_x[which] + place % wide[which], low_y[which] + place // wide[which]
    a, b = np.stack([u, v], axis=2)[which].transpose(1, 0, 2)[:2]
    c = np.stack([u[which, 2], v[which, 2]], axis=1)
    at = np.stack([x + 0.5, y + 0.5], axis=1)

    def cross(p, q):
        return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]

    area = cross(b - a, c - a)
    area[area == 0] = np.inf
    weights = np.stack([cross(c - b, at - b), cross(a - c, at - c), cross(b - a, at - a)], axis=1) / area[:, None]
    inside = (weights >= 0).all(axis=1) & np.isfinite(area)
    return which[inside], x[inside], y[inside], weights[inside]


def draw(positions, triangles, colours, *, eye, look_at, up=(0, 1, 0), angle=0.6, width=128, height=96):
    """A picture of triangles in perspective: uint8 (height x width x 3).

    `positions`: m (vertices x 3); `triangles`: vertex numbers, outward (triangles x 3); `colours`: red, green
    and blue of each, 0 to 255. The eye looks from `eye` to `look_at`, m, with `up` upward, and sees `angle`
    rad from top to bottom. Raises ValueError for a size that is not 8 to 2048 pixels."""
    for name, side in (("width", width), ("height", height)):
        if not 8 <= side <= MOST_SIDE:
            raise ValueError(f"{name}: is {side}, must be 8 to {MOST_SIDE} pixels")
    eye = np.asarray(eye, float)
    forward = _unit(np.asarray(look_at, float) - eye)
    right = _unit(np.cross(forward, up))
    axes = np.stack([right, np.cross(right, forward), forward], axis=1)
    corners = (np.asarray(positions, float) - eye)[np.asarray(triangles, np.int64)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    middles = corners.mean(axis=1)
    facing = -(normals * middles).sum(axis=1) / np.maximum(np.linalg.norm(middles, axis=1), 1e-30)
    seen = corners @ axes
    kept = np.flatnonzero((facing > 0) & (seen[:, :, 2] > 1e-3).all(axis=1))
    seen = seen[kept]
    scale = 0.5 * height / np.tan(angle / 2)
    which, x, y, weights = _fragments(width / 2 + seen[:, :, 0] / seen[:, :, 2] * scale,
                                      height / 2 - seen[:, :, 1] / seen[:, :, 2] * scale, width, height)
    nearness = (weights / seen[which][:, :, 2]).sum(axis=1)
    order = np.lexsort((which, nearness, y * width + x))
    pixel = (y * width + x)[order]
    last = np.append(pixel[1:] != pixel[:-1], True) if len(pixel) else np.zeros(0, bool)
    light = 0.3 + 0.7 * facing[kept]
    shades = (np.asarray(colours, float)[kept] * light[:, None]).astype(np.uint8)
    picture = np.empty((height * width, 3), np.uint8)
    picture[:] = GROUND
    picture[pixel[last]] = shades[which[order][last]]
    return picture.reshape(height, width, 3)


def draw_session(session, tools=(), **view):
    """The tissue of a session as it is, wounds dark, and rods for `tools`: (hand, tool, radius in m) each.

    `view`: as draw() takes it."""
    positions, triangles = session.positions.astype(float), session.triangles.astype(np.int64)
    colours = np.where(session.wounds[:, None], WOUND, TISSUE)
    for hand, tool, radius in tools:
        more, numbers = rod(session.pose(hand, tool=tool), radius)
        triangles = np.concatenate([triangles, numbers + len(positions)])
        positions = np.concatenate([positions, more])
        colours = np.concatenate([colours, np.tile(STEEL, (len(numbers), 1))])
    return draw(positions, triangles, colours, **view)


def png(picture):
    """The bytes of a PNG file of a picture, uint8 (height x width x 3)."""
    picture = np.ascontiguousarray(picture, np.uint8)
    height, width, _ = picture.shape

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + chunk(b"IEND", b""))
