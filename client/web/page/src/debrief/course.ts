// A course is what tools did over time, in bins: force, tip, way, what they held. It is filled from
// the overview of a recording, or from its frames, in whatever order they are played.

import type { Overview } from '../gen/proto/journal_pb';
import type { FrameState, Vec3 as WireVec3 } from '../gen/proto/wire_pb';
import { kBadOverview } from '../recording';
import { Verb, type Vec3 } from '../replica';

export const kBinTicks = 256; // overviews have the same
const kFrameGap = 64,
  kHasClaim = 8,
  kMostBins = 120;

export interface Bin {
  newton: number; // the greatest
  tip: Vec3; // m, at its end
  pathM: number;
  verb: Verb;
  hasClaim: boolean;
  last: number; // tick up to which it is filled
}
export type Quantity = 'force' | 'speed' | 'path';
export interface Hold {
  tool: number;
  verb: Verb;
  from: number;
  to: number;
} // ticks

export class Course {
  version = 0;
  private readonly tools = new Map<number, Map<number, Bin>>(); // tool slot -> number of the bin
  private readonly before = new Map<number, { tick: number; tip: Vec3 }>();

  get slots(): number[] {
    return [...this.tools.keys()].sort((a, b) => a - b);
  }

  addState(tick: number, state: FrameState): void {
    for (const tool of state.tool) {
      const at = tool.proxyPositionM ?? tool.positionM,
        tip = vec(at),
        force = vec(tool.forceN),
        before = this.before.get(tool.tool);
      const way =
        before && tick > before.tick && tick - before.tick <= kFrameGap
          ? distance(tip, before.tip)
          : 0;
      this.before.set(tool.tool, { tick, tip });
      const bins = this.binsOf(tool.tool),
        number = Math.floor((tick - 1) / kBinTicks),
        bin = bins.get(number);
      if (bin && tick <= bin.last) continue;
      const newton = Math.hypot(...force);
      bins.set(number, {
        newton: Math.max(newton, bin?.newton ?? 0),
        tip,
        pathM: (bin?.pathM ?? 0) + way,
        verb: tool.verb as number as Verb,
        hasClaim: tool.hasClaim,
        last: tick,
      });
      this.version++;
    }
  }

  // Throws, with one line, if it cannot be right.
  addOverview(overview: Overview): void {
    if (overview.binTicks !== kBinTicks || overview.bins > kMostBins) throw new Error(kBadOverview);
    const first = Number(overview.firstTick);
    for (const tool of overview.tool) {
      const bins = this.binsOf(tool.tool),
        at: Vec3 = [0, 0, 0];
      for (let i = 0; i < Math.min(tool.state.length, overview.bins); i++) {
        at[0] += tool.xUm[i] ?? 0;
        at[1] += tool.yUm[i] ?? 0;
        at[2] += tool.zUm[i] ?? 0;
        const state = tool.state[i] ?? 0,
          last = first + (i + 1) * kBinTicks;
        if (state === 0) continue;
        bins.set(Math.floor((last - 1) / kBinTicks), {
          newton: (tool.forceMn[i] ?? 0) / 1000,
          tip: [at[0] / 1e6, at[1] / 1e6, at[2] / 1e6],
          pathM: (tool.pathUm[i] ?? 0) / 1e6,
          verb: ((state - 1) & 7) as Verb,
          hasClaim: state - 1 >= kHasClaim,
          last,
        });
      }
    }
    this.version++;
  }

  // Columns for a plot: seconds, then a value of each tool, nothing where it is unknown. At most
  // about `most` rows: then each has the greatest of several bins.
  columns(
    what: Quantity,
    from: number,
    to: number,
    most: number,
  ): [number[], ...(number | null)[][]] {
    const first = Math.floor(from / kBinTicks),
      last = Math.max(first, Math.floor(to / kBinTicks));
    const each = Math.max(1, Math.ceil((last - first + 1) / most)),
      seconds: number[] = [];
    for (let bin = first; bin <= last; bin += each) seconds.push((bin * kBinTicks) / 1000);
    return [
      seconds,
      ...this.slots.map(slot => {
        const bins = this.binsOf(slot),
          values: (number | null)[] = [];
        let way = 0;
        for (let bin = first; bin <= last; bin += each) {
          let top: number | null = null;
          for (let k = bin; k < bin + each; k++) {
            const known = bins.get(k);
            if (!known) continue;
            way += known.pathM * 1000;
            const value =
              what === 'force'
                ? known.newton
                : what === 'speed'
                  ? (known.pathM * 1e6) / kBinTicks
                  : way;
            if (top === null || value > top) top = value;
          }
          values.push(top);
        }
        return values;
      }),
    ];
  }

  // Every bin, by time and tool; `tick` is its first.
  rows(): { tool: number; tick: number; bin: Bin }[] {
    return this.slots
      .flatMap(tool =>
        [...this.binsOf(tool)].map(([number, bin]) => ({ tool, tick: number * kBinTicks, bin })),
      )
      .sort((a, b) => a.tick - b.tick || a.tool - b.tool);
  }

  // Where the tip went, at most `most` places; a place that is null parts two lines.
  trace(tool: number, from: number, to: number, most: number): (Vec3 | null)[] {
    const bins = this.binsOf(tool),
      first = Math.floor(from / kBinTicks),
      last = Math.floor(to / kBinTicks),
      out: (Vec3 | null)[] = [];
    const each = Math.max(1, Math.ceil((last - first + 1) / most));
    for (let bin = first; bin <= last; bin += each) {
      const tip = bins.get(bin)?.tip ?? null;
      if (tip !== null || out.at(-1) !== null) out.push(tip);
    }
    return out;
  }

  // What tools had a hold of, when.
  holds(): Hold[] {
    const out: Hold[] = [];
    for (const tool of this.slots) {
      let open: Hold | null = null;
      for (const [number, bin] of [...this.binsOf(tool)].sort((a, b) => a[0] - b[0])) {
        const from = number * kBinTicks,
          to = from + kBinTicks;
        if (open && bin.hasClaim && bin.verb === open.verb && from <= open.to) open.to = to;
        else if (bin.hasClaim) out.push((open = { tool, verb: bin.verb, from, to }));
        else open = null;
      }
    }
    return out;
  }

  private binsOf(tool: number): Map<number, Bin> {
    let bins = this.tools.get(tool);
    if (!bins) this.tools.set(tool, (bins = new Map()));
    return bins;
  }
}

const vec = (v: WireVec3 | undefined): Vec3 => [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0];
export const distance = (a: Vec3, b: Vec3): number =>
  Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
