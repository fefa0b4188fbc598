// Forces over time: bins of 64 ms with the greatest of each, per participant's slot.

export const kBinTicks = 64;

export class Forces {
  private readonly bins = new Map<number, Map<number, number>>(); // slot -> bin -> N
  version = 0;

  add(tick: number, slot: number, newton: number): void {
    const bin = Math.floor(tick / kBinTicks);
    let of = this.bins.get(slot);
    if (!of) this.bins.set(slot, (of = new Map()));
    const known = of.get(bin);
    if (known !== undefined && known >= newton) return;
    of.set(bin, newton);
    this.version++;
  }
  get slots(): number[] {
    return [...this.bins.keys()].sort((a, b) => a - b);
  }
  // Drops what is older than `tick`: a session that goes on for hours keeps its last part.
  forget(tick: number): void {
    const least = Math.floor(tick / kBinTicks);
    for (const of of this.bins.values())
      for (const bin of of.keys()) if (bin < least) of.delete(bin);
  }
  greatest(slot: number): number {
    return Math.max(0, ...(this.bins.get(slot)?.values() ?? []));
  }

  // Columns for a plot: seconds, then N of each slot, nothing where it is unknown. At most `most`
  // rows: then each has the greatest of several bins.
  columns(from: number, to: number, most: number): [number[], ...(number | null)[][]] {
    const first = Math.floor(from / kBinTicks),
      last = Math.max(first, Math.floor(to / kBinTicks));
    const each = Math.max(1, Math.ceil((last - first + 1) / most)),
      seconds: number[] = [],
      slots = this.slots;
    const values: (number | null)[][] = slots.map(() => []);
    for (let bin = first; bin <= last; bin += each) {
      seconds.push((bin * kBinTicks) / 1000);
      slots.forEach((slot, i) => {
        let top: number | null = null;
        for (let k = bin; k < bin + each; k++) {
          const value = this.bins.get(slot)?.get(k);
          if (value !== undefined && (top === null || value > top)) top = value;
        }
        values[i]?.push(top);
      });
    }
    return [seconds, ...values];
  }
}
