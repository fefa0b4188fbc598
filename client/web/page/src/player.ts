// Plays a recording into the replica: a clock of ticks, and what falls due.

import { fromBinary } from '@bufbuild/protobuf';
import { ParticipantsSchema, type Participants } from './gen/proto/wire_pb';
import { kDamaged, type Item, type Recording } from './recording';
import type { Replica } from './replica';

export const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16];
const kAheadItems = 400;

export class Player {
  tick: number;
  isPlaying = false;
  isSeeking = false;
  speed = 1;
  range: [number, number] | null = null; // ticks; played again and again
  onItem: (item: Item) => void = () => undefined; // each that is shown
  people: Participants | null = null;
  fault = ''; // one line for people
  seekMs = 0; // that the last seek took
  private waiting: Item[] = [];
  private stream: AsyncGenerator<Item> | null = null;
  private isReading = false;
  private hasEnded = false;
  private generation = 0;
  private hasFine = false; // it was looked for
  private isClosed = false;
  private wanted: number | null = null;
  private lastMs = performance.now();

  constructor(
    readonly recording: Recording,
    private readonly replica: Replica,
    private readonly onChange: () => void,
  ) {
    this.tick = recording.firstTick;
  }

  play(): void {
    const [from, to] = this.range ?? [this.recording.firstTick, this.recording.lastTick - 1];
    if (this.tick >= to) void this.seek(from);
    this.isPlaying = true;
    this.onChange();
  }
  pause(): void {
    this.isPlaying = false;
    this.onChange();
  }

  // From now on the replica is somebody else's: what is still being read is not shown.
  close(): void {
    this.isClosed = true;
    this.stream = null;
  }

  // Shows the last frame at or before `tick`. While one seek runs, only the newest wish waits.
  async seek(tick: number): Promise<void> {
    this.wanted = Math.max(this.recording.firstTick, Math.min(this.recording.lastTick, tick));
    this.tick = this.wanted;
    if (this.isSeeking) return;
    this.isSeeking = true;
    while (this.wanted !== null) {
      const to: number = this.wanted,
        begin = performance.now();
      this.wanted = null;
      this.generation++;
      this.stream = null;
      this.waiting = [];
      this.hasEnded = false;
      try {
        const items = await this.recording.seek(to);
        if (this.isClosed) return;
        for (const item of items) this.feed(item);
        this.stream = this.recording.follow(to);
        this.fault = '';
      } catch (error) {
        this.fail(error);
      }
      this.seekMs = performance.now() - begin;
    }
    this.isSeeking = false;
    this.lastMs = performance.now();
    this.onChange();
    void this.loadFine();
  }
  // After the first picture, which it is not needed for. What is wrong with it costs the finer
  // surface alone.
  private async loadFine(): Promise<void> {
    if (this.hasFine) return;
    this.hasFine = true;
    try {
      const fine = await this.recording.fineSurface();
      if (fine && !this.isClosed) this.replica.receiveFineSurface(fine);
    } catch {
      if (!this.isClosed) this.replica.receiveFineSurface(new Uint8Array([0xff]));
    }
  }

  // Once per picture.
  advance(nowMs: number): void {
    const passed = Math.min(250, nowMs - this.lastMs);
    this.lastMs = nowMs;
    if (this.isSeeking || this.stream === null) return;
    void this.readAhead();
    if (!this.isPlaying) return;
    const before = this.tick,
      next = before + passed * this.speed;
    // The clock waits for frames that have not been loaded yet.
    const loaded = this.hasEnded
      ? this.recording.lastTick
      : (this.waiting.at(-1)?.tick ?? this.tick);
    this.tick = Math.min(next, Math.max(this.tick, loaded));
    let due = 0;
    while (due < this.waiting.length && (this.waiting[due]?.tick ?? Infinity) <= this.tick) due++;
    try {
      for (const item of this.waiting.splice(0, due)) this.feed(item);
    } catch (error) {
      this.fail(error);
    }
    if (this.range && before < this.range[1] && this.tick >= this.range[1])
      void this.seek(this.range[0]);
    else if (this.tick >= this.recording.lastTick) this.pause();
  }

  private feed(item: Item): void {
    if (item.name === 'participants') this.people = fromBinary(ParticipantsSchema, item.data);
    if (item.name) this.replica.receiveBare(item.name, item.data, performance.now());
    this.replica.takeOutbox(); // a recording answers nobody
    this.onItem(item);
  }
  private async readAhead(): Promise<void> {
    if (this.isReading || this.hasEnded || this.waiting.length >= kAheadItems) return;
    this.isReading = true;
    const { generation, stream } = this;
    try {
      while (
        stream !== null &&
        generation === this.generation &&
        this.waiting.length < kAheadItems
      ) {
        const next = await stream.next();
        if (generation !== this.generation) break;
        if (next.done) {
          this.hasEnded = true;
          break;
        }
        this.waiting.push(next.value);
      }
    } catch (error) {
      this.fail(error);
    }
    this.isReading = false;
  }
  private fail(error: unknown): void {
    this.isPlaying = false;
    this.fault =
      error instanceof Error && / recording/i.test(error.message) ? error.message : kDamaged;
    this.stream = null;
    this.onChange();
  }
}
