# pyright: standard
"""Rays through the empty room: light of the lamp, ambient light, distance."""

import math

import numpy as np

from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.numba_in_threads import njit, prange
from studio.results.drawing_footage.noise_kernels import hashed, value_noise
from studio.results.drawing_footage.room import BOOKS, CARPET, CHECKS, GRAIN, PLANKS, POSTER, TILES

FAR = 1e9
LAMP_SAMPLES = 12
FLOOR, CEILING, WALL, BLOCKS = -1, -2, -3, 0
FLOOR_COLOUR, FLOOR_SECOND = (0.55, 0.50, 0.44), (0.47, 0.43, 0.38)
WALL_COLOUR, SKIRTING = (0.68, 0.67, 0.63), (0.46, 0.44, 0.42)
SKIRTING_HEIGHT = 90.0


@njit(error_model="numpy", fastmath=True)
def block_entry(ox, oy, oz, dx, dy, dz, block):
    """Distance along a ray to a turned box and the axis of the face it enters (0..2); (FAR, 0) when it misses."""
    cosine, sine = block[12], block[13]
    x, y = ox - block[0], oy - block[1]
    start = (cosine * x + sine * y, -sine * x + cosine * y, oz - block[2])
    ahead = (cosine * dx + sine * dy, -sine * dx + cosine * dy, dz)
    enter, leave, face = 0.0, FAR, 0
    for axis in range(3):
        speed = ahead[axis] if abs(ahead[axis]) > 1e-12 else 1e-12
        one = (-block[3 + axis] - start[axis]) / speed
        two = (block[3 + axis] - start[axis]) / speed
        if one > two:
            one, two = two, one
        if one > enter:
            enter, face = one, axis
        leave = min(leave, two)
    return (enter, face) if enter < leave and enter > 0.0 else (FAR, 0)


@njit(error_model="numpy", fastmath=True)
def first_surface(ox, oy, oz, dx, dy, dz, half_x, half_y, height, blocks):
    """(distance, what, face axis) of the nearest surface; what is a block's index or FLOOR, CEILING, WALL."""
    best, what, face = FAR, FLOOR, 2
    if dz < -1e-9:
        best = -oz / dz
    elif dz > 1e-9:
        best, what = (height - oz) / dz, CEILING
    if abs(dx) > 1e-9:
        t = (math.copysign(half_x, dx) - ox) / dx
        if t < best:
            best, what, face = t, WALL, 0
    if abs(dy) > 1e-9:
        t = (math.copysign(half_y, dy) - oy) / dy
        if t < best:
            best, what, face = t, WALL, 1
    for index in range(len(blocks)):
        t, entered = block_entry(ox, oy, oz, dx, dy, dz, blocks[index])
        if t < best:
            best, what, face = t, index, entered
    return best, what, face


@njit(error_model="numpy", fastmath=True)
def pattern_share(pattern, u, v):
    """Share of the second colour in a pattern at (u, v) mm of a face, and a factor for its brightness."""
    grain = value_noise(u / 14.0, v / 14.0, 3.0) - 0.5
    if pattern == PLANKS:
        plank = math.floor(v / 140.0)
        board = math.floor((u + 431.0 * hashed(int(plank), 3, 5)) / 900.0)
        tone = hashed(int(plank), int(board), 11)
        seam = 0.72 if v - 140.0 * plank < 4.0 else 1.0
        streak = value_noise(u / 160.0, v / 7.0, 1.0)
        return tone, seam * (0.92 + 0.16 * streak)
    if pattern == GRAIN:
        return value_noise(u / 220.0, v / 12.0, 2.0), 1.0 + 0.05 * grain
    if pattern == BOOKS:
        shelf = math.floor(v / 290.0)
        if v - 290.0 * shelf < 26.0:
            return 0.0, 1.0
        book = math.floor((u + 37.0 * shelf) / 44.0)
        return hashed(int(book), int(shelf), 7), 0.55 + 0.7 * hashed(int(book), int(shelf), 8)
    if pattern == CHECKS:
        return float((math.floor(u / 80.0) + math.floor(v / 80.0)) & 1), 1.0 + 0.08 * grain
    if pattern == POSTER:
        return 1.0 if value_noise(u / 150.0, v / 150.0, 9.0) > 0.5 else 0.0, 1.0 + 0.1 * grain
    if pattern == TILES:
        edge = min(u - 210.0 * math.floor(u / 210.0), v - 210.0 * math.floor(v / 210.0))
        return 1.0 if edge < 14.0 else 0.35 * value_noise(u / 25.0, v / 25.0, 4.0), 1.0 + 0.12 * grain
    if pattern == CARPET:
        return value_noise(u / 700.0, v / 700.0, 5.0), 1.0 + 0.3 * grain
    return 0.0, 1.0 + 0.05 * grain


@njit(error_model="numpy", fastmath=True)
def surface_colour(what, face, px, py, pz, blocks, patterns, colour):
    """Writes the (3,) colour of a point of the room."""
    pattern, share, tone = PLANKS, 0.0, 1.0
    if what >= BLOCKS:
        block, pattern = blocks[what], patterns[what]
        x, y = px - block[0], py - block[1]
        x, y = block[12] * x + block[13] * y, -block[13] * x + block[12] * y
        u, v = (x, y) if face == 2 else ((y, pz) if face == 0 else (x, pz))
        share, tone = pattern_share(pattern, u + block[3], v)
        for channel in range(3):
            colour[channel] = tone * (block[6 + channel] + share * (block[9 + channel] - block[6 + channel]))
        return
    if what == FLOOR:
        share, tone = pattern_share(PLANKS, px, py)
        for channel in range(3):
            colour[channel] = tone * (
                FLOOR_COLOUR[channel] + share * (FLOOR_SECOND[channel] - FLOOR_COLOUR[channel])
            )
        return
    stain = value_noise(px / 300.0, py / 300.0, pz / 300.0) - 0.5
    low = what == WALL and pz < SKIRTING_HEIGHT
    for channel in range(3):
        colour[channel] = (SKIRTING[channel] if low else WALL_COLOUR[channel]) * (1.0 + 0.08 * stain)


@njit(error_model="numpy", fastmath=True)
def lamp_share(px, py, pz, lights, blocks, salt):
    """Share of the round lamp that a point of the room sees past the furniture, 0...1."""
    seen = 0
    turn = 2.0 * math.pi * hashed(int(px * 8.0), int(py * 8.0), int(pz * 8.0) + salt)
    for sample in range(LAMP_SAMPLES):
        radius = lights[1, 0] * math.sqrt((sample + 0.5) / LAMP_SAMPLES)
        angle = turn + 2.399963 * sample
        x = lights[0, 0] + radius * math.cos(angle) - px
        y = lights[0, 1] + radius * math.sin(angle) - py
        z = lights[0, 2] - pz
        reach = math.sqrt(x * x + y * y + z * z)
        free = True
        for index in range(len(blocks)):
            t, _ = block_entry(px, py, pz, x / reach, y / reach, z / reach, blocks[index])
            if t < reach:
                free = False
                break
        seen += 1 if free else 0
    return seen / LAMP_SAMPLES


@njit(error_model="numpy", fastmath=True, parallel=True)
def trace_room(
    origin: Array,
    rays: Floats,
    samples: int,
    size: Array,
    lights: Array,
    blocks: Array,
    patterns: Indices,
    key: Array,
    ambient: Array,
    depth: Array,
) -> None:
    """The empty room.

    size : (3,) half widths and height. Fills key and ambient light (h, w, 3) and depth (h, w).
    """
    height, width = depth.shape
    for row in prange(height):
        colour = np.zeros(3)
        for column in range(width):
            for sample in range(samples * samples):
                ray = rays[row * samples + sample // samples, column * samples + sample % samples]
                dx, dy, dz = np.float64(ray[0]), np.float64(ray[1]), np.float64(ray[2])
                t, what, face = first_surface(
                    origin[0], origin[1], origin[2], dx, dy, dz, size[0], size[1], size[2], blocks
                )
                px, py, pz = origin[0] + t * dx, origin[1] + t * dy, origin[2] + t * dz
                surface_colour(what, face, px, py, pz, blocks, patterns, colour)
                px, py, pz = px - 0.5 * dx, py - 0.5 * dy, pz - 0.5 * dz
                x, y, z = lights[0, 0] - px, lights[0, 1] - py, lights[0, 2] - pz
                reach = math.sqrt(x * x + y * y + z * z)
                facing = abs(z if face == 2 else (x if face == 0 else y)) / reach
                lamp = facing * lamp_share(px, py, pz, lights, blocks, sample)
                corner = min(size[0] - abs(px), size[1] - abs(py))
                openness = 1.0 - 0.25 * math.exp(-max(corner, 0.0) / 260.0) - 0.12 * math.exp(-pz / 200.0)
                for channel in range(3):
                    key[row, column, channel] += (
                        colour[channel] * lamp * lights[2, channel] / (samples * samples)
                    )
                    light = colour[channel] * openness * lights[3, channel]
                    ambient[row, column, channel] += light / (samples * samples)
                depth[row, column] += t / (samples * samples)
