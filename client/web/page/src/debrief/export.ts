// What a person takes along: the picture as it is shown, and tables of forces and events.

import type { RecordedEvent } from '../recording';
import type { Tool } from '../replica';
import type { Guide } from '../instruments';
import type { Picture } from '../scene';
import { hex } from '../panels';
import { kBinTicks, type Course } from './course';
import { kLabelAbove, label, sketch, type Line } from './sketch';

const kVerbNames = ['none', 'push', 'grasp', 'cut'];

// A canvas with the picture, names, forces and lines, for files that a person takes along.
export class Still {
  readonly canvas = document.createElement('canvas');
  isWanted = false; // each picture goes there
  private waiting: (() => void)[] = [];
  // The canvas has the next picture.
  next(): Promise<void> {
    return new Promise(resolve => this.waiting.push(resolve));
  }
  // While the pixels of the picture are there.
  drawn(picture: Picture, lines: Line[], tools: Tool[], guide: Guide): void {
    if (!this.isWanted && this.waiting.length === 0) return;
    compose(this.canvas, picture, lines, tools, guide);
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}

// Draws the newest picture with names, forces and lines.
function compose(
  copy: HTMLCanvasElement,
  picture: Picture,
  lines: Line[],
  tools: Tool[],
  guide: Guide,
): void {
  const { canvas } = picture,
    to = copy.getContext('2d');
  if (!to) return;
  if (copy.width !== canvas.width || copy.height !== canvas.height)
    [copy.width, copy.height] = [canvas.width, canvas.height];
  to.resetTransform();
  to.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--ground').trim();
  to.fillRect(0, 0, copy.width, copy.height);
  to.drawImage(canvas, 0, 0);
  const scale = canvas.width / Math.max(1, canvas.clientWidth);
  sketch(to, picture, lines, scale);
  to.scale(scale, scale);
  for (const tool of tools) {
    const at = picture.project(tool.tip),
      said = guide.labelOf(tool);
    if (at) label(to, said.text, at[0], at[1] - kLabelAbove, hex(said.colour));
  }
}

// A cell with text: in quotation marks, on one line. A sign that makes a formula in spreadsheets
// gets an apostrophe before it.
const cell = (text: string): string =>
  `"${text
    .replace(/[\r\n]+/g, ' ')
    .replace(/^(?=[=+\-@\t])/, "'")
    .replaceAll('"', '""')}"`;

export function forcesTable(course: Course, nameOf: (tool: number) => string): string {
  const rows = course
    .rows()
    .map(({ tool, tick, bin }) =>
      [
        (tick / 1000).toFixed(3),
        tool,
        cell(nameOf(tool)),
        bin.newton.toFixed(3),
        ((bin.pathM * 1e6) / kBinTicks).toFixed(2),
        (bin.pathM * 1000).toFixed(3),
        kVerbNames[bin.verb] ?? '',
        bin.hasClaim ? 1 : 0,
      ].join(','),
    );
  return ['time_s,tool,name,force_n,speed_mm_s,path_mm,verb,has_claim', ...rows, ''].join('\n');
}
export function eventsTable(events: RecordedEvent[]): string {
  return [
    'time_s,kind,text',
    ...events.map(e => [(e.tick / 1000).toFixed(3), e.kind, cell(e.text)].join(',')),
    '',
  ].join('\n');
}
