# pyright: standard
"""Kernels that weigh poses on a CUDA device: frames of the limbs, then edges, region and areas in one launch.

`frames_kernel` gives a thread to each pose. `terms_kernel` makes the kernel that gives a block of threads to each pose
in each view: it projects the limbs' outlines, samples edges and region (Eq. 14 and 15 of Deutscher & Reid 2005), and
finds the area of the limbs' union and of what it shares with the silhouette (Fleischmann et al. 2012, section 2.2).
The union is drawn into words that the block shares, limb by limb and a thread for each row, and no further than the
body reaches: no two threads set bits of one word at once. What does not fit these words is drawn and counted in bands,
so pictures and bodies may have any size.
`weigh_poses` adds up Eq. 16 and 17 with the third term.

Outlines, lines, hidden samples and pixels come from the scalar helpers of `outline_kernels`, `edge_region_kernels` and
`occlusion_kernels`, compiled for the device from the same source. Numba makes 64 bits of sums and
shifts, and tries signed indices for being negative, so indices are unsigned and cast back.

**Equal to the processor's.** Sums are of whole numbers, so their order changes nothing: they differ only where a place
that both round in single precision falls on either side of a pixel's border, which one sample in ten thousand does,
and where a span does, which one view in a hundred does by a pixel.
"""

import functools
import math
from typing import Any

import numpy as np

from studio.foundations.numba_on_devices import cuda
from studio.search.likelihood.edge_region_kernels import (
    EDGE_LINES,
    FIRST_STRIP,
    NOT_COUNTED,
    NOTHING_SEEN,
    REGION_LINES,
    SECOND_STRIP,
    THIRD_STRIP,
    WORST,
    line_between,
    sides_of,
    stepped,
)
from studio.search.likelihood.kinematic_program import FIXED_MOVE
from studio.search.likelihood.occlusion_kernels import hidden_interval, sample_bits
from studio.search.likelihood.outline_kernels import (
    FULL_TURN,
    HALF,
    ONE,
    TURNS,
    ZERO,
    combined,
    limb_axes,
    projected,
    rotated,
    sine_cosine,
    view_of,
)

THREADS = 32
"""Of a block of `add_terms`: those that run in step, so that they wait for each other at little cost."""
FAST_HERE = {"contract", "reassoc", "nsz", "arcp", "afn"}
"""As `numba_in_threads.FAST`: not a number and infinity keep their meaning."""
FRAME = 12
"""Numbers of a limb's frame: rows of (3, 4)."""
MOST_LIMBS = 64
CORNERS = 4
CORNER, LINE, EDGE, LIMB = 4, 4, 4, 6
"""Numbers kept of a corner (x, y, how it is seen, depth), of a line (first place, step), of an outline's edge (place,
slope, which side of the limb it bounds) and of a limb's area (first and last row and column, how it is seen, area)."""
WORD, WORDS = 32, 768
"""Bits of a word, and words of the union that are kept at once."""
FAR = np.float32(1e9)
LEFT, RIGHT, NEITHER = np.float32(1.0), np.float32(2.0), np.float32(0.0)
AWAY = np.float32(-1e6)
EDGE_SUM, REGION_SUM, LOST, DRAWN, SHARED, OUTSIDE = range(6)
SUMS = 6
PARTIAL, PADDED = 5, THREADS + 1
"""The first of the sums, which every thread has a part of."""
EDGE_BASE, REGION_BASE, WIDTH, HEIGHT, WORD_BASE, PITCH, SMALL_WIDTH, SMALL_HEIGHT, OBSERVED = range(9)
PLACES = 9
"""Numbers of a view of a frame: where its maps begin in the values, the pictures' size; where its silhouette begins in
the words, words a row, the silhouettes' size, pixels in the silhouette."""
ALL_BITS, NO_BITS = np.uint32(0xFFFFFFFF), np.uint32(0)
NONE_ON, ONE_ON, TWO_ON, THREE_ON, FIVE_ON = (np.uint32(number) for number in (0, 1, 2, 3, 5))
THIRTY_ONE, ALL_ON = np.uint32(31), np.uint32(THREADS)
"""Distances, which stay unsigned and narrow: signed ones are tried for being negative at every use."""
NOTHING_HIDDEN, ONE_BIT = np.uint64(0), np.uint64(1)
SHARED_BYTES = 48_000
"""What a block of threads can share, at most."""


def turn_poses(given, poses):
    """Poses (D, N) from given ones (N, D), both in single precision."""
    pose = cuda.grid(1)
    if pose >= given.shape[0]:
        return
    for entry in range(given.shape[1]):
        poses[entry, pose] = given[pose, entry]


@functools.cache
def frames_kernel(joints: int) -> tuple[Any, int]:
    """The kernel `find_frames` for bodies of so many joints, and how many poses a block of it takes, a thread each."""
    numbers = FRAME * joints
    stride = numbers + 1
    together = max(1, min(32, SHARED_BYTES // (4 * stride)))
    room = together * stride
    whole, apart, beside = np.uint32(numbers), np.uint32(stride), np.uint32(together)

    def find_frames(poses, parent, first, kinds, parameters, values, fixed, frames):
        """World frames (N, 12 F), rows of (3, 4), of poses (D, N). They are found in memory that the block shares and
        written side by side.
        """
        thread = np.uint32(cuda.threadIdx.x)
        begin = np.uint32(np.uint32(cuda.blockIdx.x) * beside)
        pose, count = np.uint32(begin + thread), np.uint32(poses.shape[1])
        kept = cuda.shared.array(room, np.float32)
        own = np.uint32(thread * apart)
        if pose < count:
            for joint in range(joints):
                place = np.uint32(own + np.uint32(FRAME * joint))
                before = parent[joint]
                for i in range(FRAME):
                    value = ONE if i % 5 == 0 else ZERO
                    if before >= 0:
                        value = kept[np.uint32(own + np.uint32(FRAME * before + i))]
                    kept[np.uint32(place + np.uint32(i))] = value
                for k in range(first[joint], first[joint + 1]):
                    kind = kinds[k]
                    if kind < 3:
                        angle = np.float64(values[k]) * np.float64(poses[parameters[k], pose])
                        sine, cosine = sine_cosine(
                            np.float32(angle - FULL_TURN * math.floor(angle * TURNS + 0.5))
                        )
                        second = np.uint32(place + np.uint32(0 if kind == 2 else kind + 1))
                        third = np.uint32(place + np.uint32(2 if kind == 0 else kind - 1))
                        for row in range(0, FRAME, 4):
                            one, other = np.uint32(second + np.uint32(row)), np.uint32(third + np.uint32(row))
                            a, b = rotated(cosine, sine, kept[one], kept[other])
                            kept[one], kept[other] = a, b
                    elif kind < FIXED_MOVE:
                        distance = values[k] * poses[parameters[k], pose]
                        along = np.uint32(place + np.uint32(kind - 3))
                        for row in range(0, FRAME, 4):
                            at = np.uint32(place + np.uint32(row + 3))
                            kept[at] += kept[np.uint32(along + np.uint32(row))] * distance
                    else:
                        for row in range(0, FRAME, 4):
                            at = np.uint32(place + np.uint32(row))
                            x, y, z = kept[at], kept[np.uint32(at + ONE_ON)], kept[np.uint32(at + TWO_ON)]
                            if kind != FIXED_MOVE:
                                for column in range(3):
                                    kept[np.uint32(at + np.uint32(column))] = combined(
                                        x, y, z, fixed[k, 0, column], fixed[k, 1, column], fixed[k, 2, column]
                                    )
                            kept[np.uint32(at + THREE_ON)] += combined(
                                x, y, z, fixed[k, 0, 3], fixed[k, 1, 3], fixed[k, 2, 3]
                            )
        cuda.syncthreads()
        written = begin
        while written < min(np.uint32(begin + beside), count):
            at = thread
            while at < whole:
                frames[written, at] = kept[np.uint32(np.uint32(np.uint32(written - begin) * apart) + at)]
                at = np.uint32(at + beside)
            written = np.uint32(written + ONE_ON)

    return cuda.jit(find_frames), together


@cuda.jit(device=True, fastmath=FAST_HERE)
def fill_corners(frames, limb_frame, limb_shape, view, pose, thread, count, corners):
    """Fill a block's corners (4 L, 4) of a pose's limbs in a view: place, pixels, how it is seen, depth of the limb's
    middle. A thread of the block does every ALL_ON-th of `count`.
    """
    at = thread
    while at < count:
        limb, corner = np.uint32(at >> TWO_ON), np.uint32(at & THREE_ON)
        first = np.uint32(np.uint32(FRAME) * np.uint32(limb_frame[limb]))
        frame = (
            frames[pose, first], frames[pose, np.uint32(first + ONE_ON)], frames[pose, np.uint32(first + TWO_ON)],
            frames[pose, np.uint32(first + THREE_ON)], frames[pose, np.uint32(first + np.uint32(4))],
            frames[pose, np.uint32(first + np.uint32(5))], frames[pose, np.uint32(first + np.uint32(6))],
            frames[pose, np.uint32(first + np.uint32(7))], frames[pose, np.uint32(first + np.uint32(8))],
            frames[pose, np.uint32(first + np.uint32(9))], frames[pose, np.uint32(first + np.uint32(10))],
            frames[pose, np.uint32(first + np.uint32(11))],
        )  # fmt: skip
        shape = (
            limb_shape[limb, 0], limb_shape[limb, 1], limb_shape[limb, 2], limb_shape[limb, 3],
            limb_shape[limb, 4],
        )  # fmt: skip
        start, axis, across = limb_axes(frame, shape, view)
        along, radius = ZERO, shape[1]
        if corner in (ONE_ON, TWO_ON):
            along, radius = ONE, shape[2]
        u, v, state = projected(view, start, axis, across, along, -radius if corner < TWO_ON else radius)
        corners[at, 0], corners[at, 1], corners[at, 2] = u, v, state
        corners[at, 3] = start[2] + HALF * axis[2]
        at = np.uint32(at + ALL_ON)


@functools.cache
def terms_kernel(limbs: int, edge_chunks: int, region_chunks: int, areas: bool, occlusion: bool) -> Any:  # noqa: ANN401
    """The kernel `add_terms` for bodies of so many drawn limbs and so many times sixteen samples a line.

    areas : whether the silhouettes' areas are found. occlusion : whether edge samples behind nearer limbs are left out.
    """
    all_corners, kept_lines = CORNERS * limbs, (EDGE_LINES + REGION_LINES) * limbs
    hidden_lines = EDGE_LINES * limbs if occlusion else 1
    area_limbs, area_corners, drawn_words = (limbs, all_corners, WORDS) if areas else (1, 1, 1)
    per_edge, per_region = np.uint32(16 * edge_chunks), np.uint32(16 * region_chunks)
    corner_count, strips = np.uint32(all_corners), np.uint32(REGION_LINES * limbs)
    edge_steps, region_steps = np.float32(16 * edge_chunks), np.float32(16 * region_chunks)

    def add_terms(
        frames, limb_frame, limb_shape, edge_limb, cameras, places, values, words, every, scale, sums
    ):
        """Sums (N, V, 6) of poses: the edge and the region map, samples left out, pixels of the union, those of them in
        the silhouette, area beyond the picture; a block of threads for each pose and view.

        frames : (N, 12 F). edge_limb : (K,) the limbs whose edges count. places : (P, V, 9) of the problems, of which
        each has `every` poses in turn. scale : pixels of the silhouettes a pixel of the pictures.
        """
        pose, number = np.uint32(cuda.blockIdx.x), np.uint32(cuda.blockIdx.y)
        thread = np.uint32(cuda.threadIdx.x)
        corners = cuda.shared.array((all_corners, CORNER), np.float32)
        lines = cuda.shared.array((kept_lines, LINE), np.float32)
        hidden = cuda.shared.array(hidden_lines, np.uint64)
        edges = cuda.shared.array((area_corners, EDGE), np.float32)
        about = cuda.shared.array((area_limbs, LIMB), np.float32)
        union = cuda.shared.array(drawn_words, np.uint32)
        inside = cuda.shared.array(area_limbs, np.int32)
        parts = cuda.shared.array((PARTIAL, PADDED), np.int32)
        problem = np.uint32(pose // np.uint32(every))
        wide, high = np.uint32(places[problem, number, WIDTH]), np.uint32(places[problem, number, HEIGHT])
        view = view_of(cameras[number])
        across_all, down_all = ZERO, ZERO
        fill_corners(frames, limb_frame, limb_shape, view, pose, thread, corner_count, corners)
        cuda.syncthreads()
        counted = np.uint32(np.uint32(EDGE_LINES) * np.uint32(edge_limb.shape[0]))
        at = thread
        while at < np.uint32(counted + strips):
            if at < counted:
                limb, fraction, count = np.uint32(edge_limb[np.uint32(at >> ONE_ON)]), ZERO, edge_steps
                if at & ONE_ON:
                    fraction = ONE
            else:
                strip = np.uint32(at - counted)
                limb = np.uint32(strip // np.uint32(REGION_LINES))
                strip = np.uint32(strip - np.uint32(np.uint32(REGION_LINES) * limb))
                fraction, count = FIRST_STRIP, region_steps
                if strip == ONE_ON:
                    fraction = SECOND_STRIP
                elif strip == TWO_ON:
                    fraction = THIRD_STRIP
            a0 = np.uint32(limb << TWO_ON)
            a1, b1, b0 = np.uint32(a0 + ONE_ON), np.uint32(a0 + TWO_ON), np.uint32(a0 + THREE_ON)
            a, b = sides_of(
                (
                    corners[a0, 0], corners[a0, 1], corners[a1, 0], corners[a1, 1],
                    corners[b1, 0], corners[b1, 1], corners[b0, 0], corners[b0, 1],
                )
            )  # fmt: skip
            x, y, dx, dy = line_between(a, b, fraction, count)
            if min(min(corners[a0, 2], corners[a1, 2]), min(corners[b1, 2], corners[b0, 2])) < -HALF:
                x, dx = AWAY, ZERO
            lines[at, 0], lines[at, 1], lines[at, 2], lines[at, 3] = x, y, dx, dy
            at = np.uint32(at + ALL_ON)
        if occlusion:
            at = thread
            while at < counted:
                limb = np.uint32(edge_limb[np.uint32(at >> ONE_ON)])
                a0 = np.uint32(limb << TWO_ON)
                a1, b1, b0 = np.uint32(a0 + ONE_ON), np.uint32(a0 + TWO_ON), np.uint32(a0 + THREE_ON)
                begin, end = a0, a1
                if at & ONE_ON:
                    begin, end = b0, b1
                bits = NOTHING_HIDDEN
                seen = min(min(corners[a0, 2], corners[a1, 2]), min(corners[b1, 2], corners[b0, 2]))
                side = corners[begin, 0], corners[begin, 1], corners[end, 0], corners[end, 1]
                for other in range(limbs):
                    its = CORNERS * other
                    there = min(
                        min(corners[its, 2], corners[its + 1, 2]),
                        min(corners[its + 2, 2], corners[its + 3, 2]),
                    )
                    nearer = corners[its, 3] < corners[a0, 3] and np.uint32(other) != limb
                    if nearer and there > -HALF and seen > -HALF:
                        near = (
                            corners[its, 0], corners[its, 1], corners[its + 1, 0], corners[its + 1, 1],
                            corners[its + 2, 0], corners[its + 2, 1], corners[its + 3, 0], corners[its + 3, 1],
                        )  # fmt: skip
                        bits |= sample_bits(hidden_interval(side, near), edge_steps)
                hidden[at] = bits
                at = np.uint32(at + ALL_ON)
        if areas:
            across_all, down_all = (
                np.float32(places[problem, number, SMALL_WIDTH]), np.float32(places[problem, number, SMALL_HEIGHT]),
            )  # fmt: skip
            shift = HALF - HALF * scale
            at = thread
            while at < corner_count:
                corner = np.uint32(at & THREE_ON)
                a0 = np.uint32(at - corner)
                a1, b1, b0 = np.uint32(a0 + ONE_ON), np.uint32(a0 + TWO_ON), np.uint32(a0 + THREE_ON)
                after = np.uint32(a0 + np.uint32(np.uint32(corner + ONE_ON) & THREE_ON))
                ax, ay = scale * corners[a0, 0] - shift, scale * corners[a0, 1] - shift
                bx, by = scale * corners[a1, 0] - shift, scale * corners[a1, 1] - shift
                cx, cy = scale * corners[b1, 0] - shift, scale * corners[b1, 1] - shift
                dx, dy = scale * corners[b0, 0] - shift, scale * corners[b0, 1] - shift
                area = (cx - ax) * (dy - by) - (cy - ay) * (dx - bx)
                px, py = scale * corners[at, 0] - shift, scale * corners[at, 1] - shift
                qx, qy = scale * corners[after, 0] - shift, scale * corners[after, 1] - shift
                fall = py - qy if area > ZERO else qy - py
                bounds = NEITHER
                if fall > ZERO:
                    bounds = LEFT
                elif fall < ZERO:
                    bounds = RIGHT
                edges[at, 0], edges[at, 1], edges[at, 3] = px, py, bounds
                edges[at, 2] = (qx - px) / (qy - py if fall != ZERO else ONE)
                if corner == NONE_ON:
                    limb = np.uint32(at >> TWO_ON)
                    state = min(min(corners[a0, 2], corners[a1, 2]), min(corners[b1, 2], corners[b0, 2]))
                    top = max(np.float32(math.ceil(min(min(ay, by), min(cy, dy)))), ZERO)
                    bottom = min(np.float32(math.floor(max(max(ay, by), max(cy, dy)))), down_all - ONE)
                    left = max(np.float32(math.ceil(min(min(ax, bx), min(cx, dx)))), ZERO)
                    right = min(np.float32(math.floor(max(max(ax, bx), max(cx, dx)))), across_all - ONE)
                    if state < -HALF or left > right or bottom < top:
                        top, bottom, left, right = FAR, -ONE, FAR, -ONE
                    about[limb, 0], about[limb, 1], about[limb, 2], about[limb, 3] = top, bottom, left, right
                    about[limb, 4], about[limb, 5] = state, HALF * abs(area)
                    inside[limb] = 0
                at = np.uint32(at + ALL_ON)
        cuda.syncthreads()
        width, height = np.float32(wide), np.float32(high)
        nothing = np.uint32(np.uint32(wide * high) + np.uint32(NOTHING_SEEN))
        base = np.uint64(places[problem, number, EDGE_BASE])
        edge, region, lost = np.uint32(0), np.uint32(0), np.uint32(0)
        at = thread
        while at < np.uint32(counted * per_edge):
            line = np.uint32(at // per_edge)
            sample = np.uint32(at - np.uint32(line * per_edge))
            x, y = stepped(
                (lines[line, 0], lines[line, 1], lines[line, 2], lines[line, 3]), np.float32(np.int32(sample))
            )
            index = nothing
            if x >= ZERO and x < width and y >= ZERO and y < height:
                index = np.uint32(np.uint32(np.uint32(np.int32(y)) * wide) + np.uint32(np.int32(x)))
            if occlusion and (hidden[line] >> np.uint64(sample)) & ONE_BIT:
                index = np.uint32(nothing + np.uint32(NOT_COUNTED - NOTHING_SEEN))
                lost = np.uint32(lost + ONE_ON)
            edge = np.uint32(edge + np.uint32(values[base + np.uint64(index)]))
            at = np.uint32(at + ALL_ON)
        base = np.uint64(places[problem, number, REGION_BASE])
        at = thread
        while at < np.uint32(strips * per_region):
            line = np.uint32(at // per_region)
            sample = np.uint32(at - np.uint32(line * per_region))
            line = np.uint32(line + counted)
            x, y = stepped(
                (lines[line, 0], lines[line, 1], lines[line, 2], lines[line, 3]), np.float32(np.int32(sample))
            )
            index = nothing
            if x >= ZERO and x < width and y >= ZERO and y < height:
                index = np.uint32(np.uint32(np.uint32(np.int32(y)) * wide) + np.uint32(np.int32(x)))
            region = np.uint32(region + np.uint32(values[base + np.uint64(index)]))
            at = np.uint32(at + ALL_ON)
        drawn, shared = np.uint32(0), np.uint32(0)
        if areas:
            top, bottom, left, right = FAR, -ONE, FAR, -ONE
            for limb in range(limbs):
                top, bottom = min(top, about[limb, 0]), max(bottom, about[limb, 1])
                left, right = min(left, about[limb, 2]), max(right, about[limb, 3])
            if bottom >= top:
                window = np.uint32(np.uint32(np.int32(left)) >> FIVE_ON)
                across = np.uint32(np.uint32(np.uint32(np.int32(right)) >> FIVE_ON) - window)
                across = np.uint32(across + ONE_ON)
                rows = np.uint32(np.uint32(WORDS) // across)
                begin, end = np.uint32(np.int32(top)), np.uint32(np.uint32(np.int32(bottom)) + ONE_ON)
                origin = np.uint64(places[problem, number, WORD_BASE]) + np.uint64(window)
                pitch = np.uint64(places[problem, number, PITCH])
                pixel = np.uint32(window << FIVE_ON)
                while begin < end:
                    stop = min(np.uint32(begin + rows), end)
                    at = thread
                    while at < np.uint32(np.uint32(stop - begin) * across):
                        union[at] = NO_BITS
                        at = np.uint32(at + ALL_ON)
                    cuda.syncthreads()
                    for limb in range(limbs):
                        level = max(about[limb, 0], np.float32(np.int32(begin))) + np.float32(
                            np.int32(thread)
                        )
                        lowest = min(about[limb, 1], np.float32(np.int32(stop)) - ONE)
                        while level <= lowest:
                            low, most = -FAR, FAR
                            for corner in range(CORNERS):
                                bound = CORNERS * limb + corner
                                crossing = edges[bound, 0] + edges[bound, 2] * (level - edges[bound, 1])
                                if edges[bound, 3] == LEFT:
                                    low = max(low, crossing)
                                elif edges[bound, 3] == RIGHT:
                                    most = min(most, crossing)
                            first = max(np.float32(math.ceil(low)), ZERO)
                            after = min(np.float32(math.floor(most)) + ONE, across_all)
                            if after > first:
                                if about[limb, 4] < HALF:
                                    cuda.atomic.add(inside, limb, np.int32(after - first))
                                start = np.uint32(np.uint32(np.int32(first)) - pixel)
                                final = np.uint32(np.uint32(np.uint32(np.int32(after)) - pixel) - ONE_ON)
                                row = np.uint32(np.uint32(np.int32(level)) - begin)
                                word = np.uint32(np.uint32(row * across) + np.uint32(start >> FIVE_ON))
                                end_word = np.uint32(np.uint32(row * across) + np.uint32(final >> FIVE_ON))
                                bits = np.uint32(ALL_BITS << np.uint32(start & THIRTY_ONE))
                                while word < end_word:
                                    union[word] = np.uint32(union[word] | bits)
                                    bits = ALL_BITS
                                    word = np.uint32(word + ONE_ON)
                                beyond = np.uint32(THIRTY_ONE - np.uint32(final & THIRTY_ONE))
                                bits = np.uint32(bits & np.uint32(ALL_BITS >> beyond))
                                union[word] = np.uint32(union[word] | bits)
                            level += np.float32(THREADS)
                        cuda.syncthreads()
                    row = np.uint32(begin + thread)
                    while row < stop:
                        at = np.uint32(np.uint32(row - begin) * across)
                        seen_at = origin + np.uint64(row) * pitch
                        stop_at = np.uint32(at + across)
                        while at < stop_at:
                            bits = union[at]
                            drawn = np.uint32(drawn + np.uint32(cuda.popc(bits)))
                            bits = np.uint32(bits & words[seen_at])
                            shared = np.uint32(shared + np.uint32(cuda.popc(bits)))
                            seen_at += np.uint64(ONE_ON)
                            at = np.uint32(at + ONE_ON)
                        row = np.uint32(row + ALL_ON)
                    cuda.syncthreads()
                    begin = stop
        parts[0, thread], parts[1, thread], parts[2, thread] = edge, region, lost
        parts[3, thread], parts[4, thread] = drawn, shared
        cuda.syncthreads()
        if thread < np.uint32(PARTIAL):
            total = np.int32(0)
            for other in range(THREADS):
                total += parts[thread, other]
            sums[pose, number, thread] = np.float32(total)
        elif thread == np.uint32(PARTIAL):
            outside = ZERO
            if areas:
                for limb in range(limbs):
                    if about[limb, 4] < -HALF:
                        outside += across_all * down_all
                    elif about[limb, 4] < HALF:
                        outside += max(about[limb, 5] - np.float32(inside[limb]), ZERO)
            sums[pose, number, OUTSIDE] = outside

    return cuda.jit(fastmath=FAST_HERE)(add_terms)


def weigh_poses(sums, places, every, samples, factors, found):
    """Fitness and log-weight (2, N) of poses from their sums (N, V, 6): Eq. 16 and 17 with the areas' fitness.

    samples : (2,) edge and region samples of a view. factors : (3,) of the edge, the region and the area term.
    """
    pose = cuda.grid(1)
    if pose >= sums.shape[0]:
        return
    problem = np.int32(np.int32(pose) // np.int32(every))
    views = sums.shape[1]
    fitness = 0.0
    for view in range(views):
        counted = samples[0] - np.float64(sums[pose, view, LOST])
        edge = 1.0
        if counted > 0.0:
            edge = np.float64(sums[pose, view, EDGE_SUM]) / (WORST * counted)
        region = np.float64(sums[pose, view, REGION_SUM]) / (WORST * samples[1])
        fitness += factors[0] * (1.0 - edge) + factors[1] * (1.0 - region)
        if factors[2] > 0.0:
            both = np.float64(sums[pose, view, SHARED])
            own = max(np.float64(sums[pose, view, DRAWN]) + np.float64(sums[pose, view, OUTSIDE]), 1.0)
            seen = max(np.float64(places[problem, view, OBSERVED]), 1.0)
            fitness += factors[2] * 0.5 * (both / own + both / seen)
    best = factors[0] + factors[1] + factors[2]
    found[0, pose] = fitness / views
    found[1, pose] = fitness - views * best
