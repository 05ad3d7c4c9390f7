// Bodies drawn on a canvas: limbs as tapered strokes seen from any side, arrows where their ends
// are going.

import { onTheme, token } from "./theme.js";

const START = { azimuth: -0.9, elevation: 0.16 };
const MARGIN = 0.08; // of the canvas, kept free around the body
const FURTHEST = 0.45; // how much of their colour the furthest limbs lose
const views = new Set();

let azimuth = START.azimuth;
let elevation = START.elevation;

onTheme(() => redrawAll());

function redrawAll() {
  for (const view of views) if (view.canvas.isConnected) view.draw();
}

/**
 * A canvas that shows one body; all of them are turned together by dragging, and by the arrow keys.
 */
export class BodyDrawing {
  /**
   * shapes: {side, radius_start, radius_end} of every limb. points: all ends that are ever shown,
   * for the scale. lines: [from, to, colour, width in pixels: 1] that stand behind.
   */
  constructor(canvas, shapes, points, lines = []) {
    this.canvas = canvas;
    this.lines = lines;
    this.shapes = shapes;
    this.reach = reachOf(points);
    this.limbs = null;
    this.arrows = [];
    this.points = [];
    this.clarity = 1;
    this.seen = new IntersectionObserver(
      (entries) => {
        this.isSeen = Boolean(entries.at(-1)?.isIntersecting);
        this.draw();
      },
      { rootMargin: "200px" },
    );
    this.seen.observe(canvas);
    this.sized = new ResizeObserver(() => this.draw());
    this.sized.observe(canvas);
    canvas.tabIndex = 0;
    canvas.onpointerdown = (event) => this.turn(event);
    canvas.onkeydown = (event) => {
      const step = { ArrowLeft: -0.2, ArrowRight: 0.2 }[event.key];
      if (!step) return;
      event.preventDefault();
      azimuth += step;
      redrawAll();
    };
    views.add(this);
  }

  show(limbs, arrows = []) {
    this.limbs = limbs;
    this.arrows = arrows;
    this.draw();
  }

  /**
   * Points over the body: {at: [x, y, z] mm, colour, radius: pixels, alpha}. clarity: how solid the
   * body is, 0 to 1. Drawn with the next body.
   */
  over(points, clarity = 1) {
    this.points = points;
    this.clarity = clarity;
  }

  close() {
    this.seen.disconnect();
    this.sized.disconnect();
    views.delete(this);
  }

  turn(begin) {
    const from = { azimuth, elevation };
    this.canvas.setPointerCapture(begin.pointerId);
    this.canvas.onpointermove = (event) => {
      azimuth = from.azimuth + (event.clientX - begin.clientX) / 90;
      elevation = Math.min(
        1.4,
        Math.max(-1.4, from.elevation + (event.clientY - begin.clientY) / 150),
      );
      redrawAll();
    };
    this.canvas.onpointerup = this.canvas.onpointercancel = () => {
      this.canvas.onpointermove = null;
    };
  }

  draw() {
    const { canvas } = this;
    if (!this.limbs || !this.isSeen || !canvas.clientWidth) return;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const scale = ((1 - 2 * MARGIN) * Math.min(width, height)) / (2 * this.reach.radius);
    const place = (point) => {
      const [x, y, depth] = seen(point, this.reach.middle);
      return [width / 2 + scale * x, height / 2 - scale * y, depth];
    };
    for (const [from, to, colour, width] of this.lines)
      drawLine(pen, place(from), place(to), token(colour), width);
    const limbs = this.limbs.map((ends, index) => ({
      ...this.shapes[index],
      ends: ends.map(place),
    }));
    limbs.sort((one, two) => one.ends[0][2] + one.ends[1][2] - two.ends[0][2] - two.ends[1][2]);
    pen.globalAlpha = this.clarity;
    for (const limb of limbs) drawLimb(pen, limb, scale, this.reach.radius);
    for (const { at, colour, radius, alpha } of this.points) {
      const [x, y] = place(at);
      pen.globalAlpha = alpha;
      pen.fillStyle = colour;
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
      pen.fill();
    }
    pen.globalAlpha = 1;
    for (const arrow of this.arrows) drawArrow(pen, arrow.map(place));
  }
}

/** Middle and half of the longest edge (mm) of a box around all ends. */
function reachOf(points) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const ends of points)
    for (const point of ends) {
      for (let axis = 0; axis < 3; axis += 1) {
        low[axis] = Math.min(low[axis], point[axis]);
        high[axis] = Math.max(high[axis], point[axis]);
      }
    }
  const middle = low.map((value, axis) => (value + high[axis]) / 2);
  return { middle, radius: Math.max(1, ...low.map((value, axis) => (high[axis] - value) / 2)) };
}

/** A point as it is seen: right, up and nearness, mm. */
function seen(point, middle) {
  const [x, y, z] = point.map((value, axis) => value - middle[axis]);
  const across = x * Math.cos(azimuth) - y * Math.sin(azimuth);
  const away = x * Math.sin(azimuth) + y * Math.cos(azimuth);
  return [
    across,
    z * Math.cos(elevation) + away * Math.sin(elevation),
    z * Math.sin(elevation) - away * Math.cos(elevation),
  ];
}

function drawLimb(pen, { side, ends: [near, far], radius_start, radius_end }, scale, radius) {
  const depth = Math.min(1, Math.max(0, 0.5 - (near[2] + far[2]) / (4 * radius)));
  const surface = token("surface-raised");
  pen.fillStyle = `color-mix(in srgb, ${token(`limb-${side}`)} ${Math.round(100 * (1 - FURTHEST * depth))}%, ${surface})`;
  pen.strokeStyle = surface;
  pen.lineWidth = 1;
  const [one, two] = [Math.max(1.5, radius_start * scale), Math.max(1.5, radius_end * scale)];
  const along = Math.atan2(far[1] - near[1], far[0] - near[0]);
  pen.beginPath();
  pen.arc(near[0], near[1], one, along + Math.PI / 2, along + (3 * Math.PI) / 2);
  pen.arc(far[0], far[1], two, along - Math.PI / 2, along + Math.PI / 2);
  pen.closePath();
  pen.fill();
  pen.stroke();
}

function drawLine(pen, from, to, colour, width = 1) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.lineTo(to[0], to[1]);
  pen.stroke();
}

function drawArrow(pen, [from, to]) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  if (length < 3) return;
  const head = Math.min(6, length / 2);
  const along = Math.atan2(dy, dx);
  pen.strokeStyle = pen.fillStyle = token("good");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.lineTo(to[0] - head * Math.cos(along), to[1] - head * Math.sin(along));
  pen.stroke();
  pen.beginPath();
  pen.moveTo(to[0], to[1]);
  for (const turn of [2.6, -2.6])
    pen.lineTo(
      to[0] + head * 1.4 * Math.cos(along + turn),
      to[1] + head * 1.4 * Math.sin(along + turn),
    );
  pen.closePath();
  pen.fill();
}
