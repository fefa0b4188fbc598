// What is drawn over the picture: ways of tool tips, and what is measured. It is also part of saved
// pictures and clips.

import type { Vec3 } from '../replica';
import type { Picture } from '../scene';

export interface Line {
  places: (Vec3 | null)[];
  colour: string;
  dash: number[];
  isClosed?: boolean;
  hasDots?: boolean;
  text?: string;
}

export const kLabelAbove = 18; // pixels
const kDot = 4,
  kWidth = 2,
  kFont = '600 14px system-ui, sans-serif';

// `scale`: pixels of the canvas for one of the page.
export function sketch(
  to: CanvasRenderingContext2D,
  picture: Picture,
  lines: Line[],
  scale: number,
): void {
  to.save();
  to.scale(scale, scale);
  to.lineJoin = to.lineCap = 'round';
  for (const line of lines) {
    const path = new Path2D(),
      points = line.places.map(p => (p === null ? null : picture.project(p)));
    let isOpen = false;
    for (const point of points) {
      if (point === null) isOpen = false;
      else if (isOpen) path.lineTo(...point);
      else {
        path.moveTo(...point);
        isOpen = true;
      }
    }
    if (line.isClosed && points.length > 2) path.closePath();
    // A dark rim keeps lines apart from tissue of their own colour.
    to.setLineDash([]);
    to.strokeStyle = 'rgb(10 15 20 / 0.6)';
    to.lineWidth = kWidth + 2;
    to.stroke(path);
    to.setLineDash(line.dash);
    to.strokeStyle = line.colour;
    to.lineWidth = kWidth;
    to.stroke(path);
    const seen = points.filter(p => p !== null);
    if (line.hasDots)
      for (const [x, y] of seen) {
        to.beginPath();
        to.arc(x, y, kDot, 0, 2 * Math.PI);
        to.fillStyle = line.colour;
        to.fill();
        to.setLineDash([]);
        to.lineWidth = 1;
        to.strokeStyle = 'rgb(10 15 20)';
        to.stroke();
      }
    if (line.text && seen.length > 0) {
      const x = seen.reduce((sum, p) => sum + p[0], 0) / seen.length,
        y = Math.min(...seen.map(p => p[1])) - kLabelAbove;
      label(to, line.text, x, y, line.colour);
    }
  }
  to.restore();
}

// Text on a dark ground, as labels of tools are.
export function label(
  to: CanvasRenderingContext2D,
  text: string,
  x: number,
  y: number,
  colour: string,
): void {
  to.font = kFont;
  const width = to.measureText(text).width;
  to.fillStyle = 'rgb(10 15 20 / 0.78)';
  to.fillRect(x - width / 2 - 7, y - 11, width + 12, 22);
  to.fillStyle = colour;
  to.fillRect(x - width / 2 - 7, y - 11, 3, 22);
  to.fillStyle = '#f2f6f9';
  to.textAlign = 'center';
  to.textBaseline = 'middle';
  to.fillText(text, x, y);
}
