# pyright: standard
"""Rays through the distance field of a person or another body: pictures, true coverage, and shadows on the floor."""

import math

import numpy as np

from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.numba_in_threads import njit, prange
from studio.results.drawing_footage.distance_kernels import (
    FAR,
    body_distance,
    body_normal,
    gather,
    gather_among,
    gather_beam,
    light_share,
    local_point,
    nearest_piece,
    no_pieces,
)
from studio.results.drawing_footage.flesh import CLOTHS, HAIR, SHIRT, SHOE, TROUSERS
from studio.results.drawing_footage.noise_kernels import value_noise

SAFETY, TOUCH, STEPS = 0.85, 0.8, 72
OCCLUSION_REACH = 70.0
# Pieces this far from a ray (mm) may still be blended with the surface that it hits. Pixels are traced in square tiles
# of this side.
NEAR, TILE = 12.0, 8
# Samples of one pixel this close in depth (mm) share one shading, which changes little inside a pixel.
SAME_SURFACE = 12.0


@njit(error_model="numpy", fastmath=True)
def cloth_colour(material, x, y, z, wardrobe):
    """(red, green, blue) of a point in its piece's frame, so that the pattern moves with the limb.

    wardrobe : (6 P, 3) skin, shirt, trousers, shoe, hair, and the shirt's stripe, of each of P people. material : a
    row of it.
    """
    grain = value_noise(x / 9.0, y / 9.0, z / 9.0) - 0.5
    patch = value_noise(x / 55.0 + 7.0, y / 55.0, z / 55.0) - 0.5
    r, g, b = wardrobe[material, 0], wardrobe[material, 1], wardrobe[material, 2]
    stripes = material - material % CLOTHS + CLOTHS - 1
    material %= CLOTHS
    tone = 1.0 + 0.10 * patch + 0.06 * grain
    if material == SHIRT:
        stripe = 0.5 + 0.5 * math.sin(2.0 * math.pi * z / 74.0)
        stripe = min(max((stripe - 0.72) / 0.10, 0.0), 1.0)
        r += stripe * (wardrobe[stripes, 0] - r)
        g += stripe * (wardrobe[stripes, 1] - g)
        b += stripe * (wardrobe[stripes, 2] - b)
        tone = 1.0 + 0.12 * patch + 0.10 * grain
    elif material == TROUSERS:
        tone = 1.0 + 0.22 * patch + 0.16 * grain
        if abs(x + 0.1 * y) < 3.0:
            tone *= 0.78
    elif material == SHOE:
        tone = 1.0 + 0.25 * grain
    elif material == HAIR:
        tone = 1.0 + 0.5 * (value_noise(x / 5.0, y / 5.0, z / 30.0) - 0.5)
    return r * tone, g * tone, b * tone


@njit(error_model="numpy", fastmath=True)
def shaded(px, py, pz, dx, dy, dz, person, active, count, shadow_active, out):
    """Light that a point of the person sends to the camera, written to `out` (3,), 0...1.

    person : pieces, labels, lights (4, 3: lamp position, (lamp radius, -, -), lamp colour, ambient colour), wardrobe.
    """
    pieces, labels, lights, wardrobe = person
    nx, ny, nz = body_normal(px, py, pz, pieces, labels, active, count)
    piece = nearest_piece(px, py, pz, pieces, active, count)
    x, y, z = local_point(px, py, pz, pieces[piece])
    material = labels[piece, 0]
    red, green, blue = cloth_colour(material, x, y, z, wardrobe)
    lx, ly, lz = lights[0, 0] - px, lights[0, 1] - py, lights[0, 2] - pz
    size = math.sqrt(lx * lx + ly * ly + lz * lz)
    facing = (nx * lx + ny * ly + nz * lz) / size
    key = 0.0
    if facing > 0.0:
        key = facing * light_share(px, py, pz, lights[0], lights[1, 0], pieces, labels, shadow_active)
    close = body_distance(
        px + OCCLUSION_REACH * nx,
        py + OCCLUSION_REACH * ny,
        pz + OCCLUSION_REACH * nz,
        pieces,
        labels,
        active,
        count,
    )
    openness = 0.45 + 0.55 * min(max(close / OCCLUSION_REACH, 0.0), 1.0)
    sky = openness * (0.62 + 0.38 * nz)
    fill = 0.16 * max(-(nx * dx + ny * dy + nz * dz), 0.0) * openness
    out[0] = red * (key * lights[2, 0] + sky * lights[3, 0] + fill)
    out[1] = green * (key * lights[2, 1] + sky * lights[3, 1] + fill)
    out[2] = blue * (key * lights[2, 2] + sky * lights[3, 2] + fill)


@njit(error_model="numpy", fastmath=True)
def tile_beam(rays, top, bottom, left, right):
    """The middle direction of a tile's rays and their greatest deviation from it per mm of distance."""
    ray = rays[(top + bottom) // 2, (left + right) // 2]
    dx, dy, dz = np.float64(ray[0]), np.float64(ray[1]), np.float64(ray[2])
    spread = 0.0
    for row in (top, bottom - 1):
        for column in (left, right - 1):
            other = rays[row, column]
            spread = max(spread, (other[0] - dx) ** 2 + (other[1] - dy) ** 2 + (other[2] - dz) ** 2)
    return dx, dy, dz, 1.05 * math.sqrt(spread)


@njit(error_model="numpy", fastmath=True)
def beam_start(origin, dx, dy, dz, spread, pieces, labels, active):
    """Distance that all rays of a beam run free of the person, and the number of pieces that any of them may hit (in
    `active`); (-1, n) when none hits the person.
    """
    count, t, last = gather_beam(origin, dx, dy, dz, spread, pieces, NEAR, active)
    if count == 0:
        return -1.0, count
    for _ in range(STEPS):
        if t > last:
            return -1.0, count
        distance = body_distance(
            origin[0] + t * dx, origin[1] + t * dy, origin[2] + t * dz, pieces, labels, active, count
        )
        free = distance - spread * t
        if free < 4.0 * TOUCH:
            break
        t += SAFETY * free
    return t, count


@njit(error_model="numpy", fastmath=True)
def first_touch(origin, dx, dy, dz, start, pieces, labels, nearby, near_count, active):
    """Distance along a ray to the person and the number of active pieces; (-1, n) when it misses.

    start : distance that is known to be free. nearby : the `near_count` pieces that may be touched.
    """
    count, t, last = gather_among(origin, dx, dy, dz, pieces, nearby, near_count, NEAR, active)
    if count == 0:
        return -1.0, count
    distance, t = 0.0, max(t, start)
    for _ in range(STEPS):
        if t > last:
            return -1.0, count
        distance = body_distance(
            origin[0] + t * dx, origin[1] + t * dy, origin[2] + t * dz, pieces, labels, active, count
        )
        if distance < TOUCH:
            return t, count
        t += SAFETY * distance
    return (t, count) if distance < 6.0 * TOUCH else (-1.0, count)


@njit(error_model="numpy", fastmath=True)
def trace_pixel(
    origin, rays, samples, row, column, room_depth, start, nearby, near_count, scratch, person, light
):
    """Share of a pixel that the person covers; adds the light of its samples to light[row, column].

    start, nearby, near_count : as in `first_touch`. scratch : two rows for pieces' indices. person : as in
    `shaded`.
    """
    pieces, labels = person[0], person[1]
    hits, shaded_at, each, colour = 0, -FAR, 1.0 / (samples * samples), np.zeros(3)
    for sample in range(samples * samples):
        ray = rays[row * samples + sample // samples, column * samples + sample % samples]
        dx, dy, dz = np.float64(ray[0]), np.float64(ray[1]), np.float64(ray[2])
        t, count = first_touch(origin, dx, dy, dz, start, pieces, labels, nearby, near_count, scratch[0])
        if t < 0.0 or t > room_depth[row, column]:
            continue
        hits += 1
        if abs(t - shaded_at) > SAME_SURFACE:
            shaded_at = t
            px, py, pz = origin[0] + t * dx, origin[1] + t * dy, origin[2] + t * dz
            shaded(px, py, pz, dx, dy, dz, person, scratch[0], count, scratch[1], colour)
        for channel in range(3):
            light[row, column, channel] += colour[channel] * each
    return hits * each


@njit(error_model="numpy", fastmath=True, parallel=True)
def trace_person(
    origin: Array,
    rays: Floats,
    samples: int,
    room_depth: Floats,
    pieces: Array,
    labels: Indices,
    lights: Array,
    wardrobe: Array,
    light: Floats,
    coverage: Floats,
) -> None:
    """The person as seen through a window of the picture, tile by tile.

    origin : (3,) camera centre. rays : (h * samples, w * samples, 3) unit directions. room_depth : (h, w)
    distance to the room's surfaces, mm. Fills light (h, w, 3), premultiplied by coverage (h, w), both
    0...1.
    """
    height, width = coverage.shape
    person = (pieces, labels, lights, wardrobe)
    down, across = (height + TILE - 1) // TILE, (width + TILE - 1) // TILE
    for tile in prange(down * across):
        top, left = TILE * (tile // across), TILE * (tile % across)
        bottom, right = min(top + TILE, height), min(left + TILE, width)
        nearby, scratch = no_pieces(pieces), np.zeros((2, len(pieces)), np.int64)
        dx, dy, dz, spread = tile_beam(rays, top * samples, bottom * samples, left * samples, right * samples)
        start, near_count = beam_start(origin, dx, dy, dz, spread, pieces, labels, nearby)
        if start < 0.0:
            continue
        for row in range(top, bottom):
            for column in range(left, right):
                coverage[row, column] = trace_pixel(
                    origin,
                    rays,
                    samples,
                    row,
                    column,
                    room_depth,
                    start,
                    nearby,
                    near_count,
                    scratch,
                    person,
                    light,
                )


@njit(error_model="numpy", fastmath=True, parallel=True)
def floor_shadow(
    left: float,
    near: float,
    cell: float,
    pieces: Array,
    labels: Indices,
    lights: Array,
    key: Floats,
    ambient: Floats,
) -> None:
    """Shares of the lamp's and of the ambient light that the person leaves on the floor.

    Cell (j, i) of the (n, n) outputs lies at x = left + i * cell, y = near + j * cell, mm; 1 = no shadow.
    """
    rows, columns = key.shape
    for row in prange(rows):
        active = no_pieces(pieces)
        for column in range(columns):
            x, y = left + column * cell, near + row * cell
            key[row, column] = light_share(x, y, 0.0, lights[0], lights[1, 0], pieces, labels, active)
            count, _, _ = gather(x, y, -1.0, 0.0, 0.0, 1.0, pieces, 160.0, active)
            taken = 0.0
            if count > 0:
                for height, weight in ((30.0, 0.20), (110.0, 0.14)):
                    distance = body_distance(x, y, height, pieces, labels, active, count)
                    taken += weight * min(max(1.0 - distance / (1.4 * height), 0.0), 1.0)
            ambient[row, column] = 1.0 - taken
