// A recording, over HTTP ranges or from a dropped file. Only what is shown is loaded: whole blocks,
// of which the last ones used are kept.

import { fromBinary, toBinary } from '@bufbuild/protobuf';
import { BinaryReader, WireType } from '@bufbuild/protobuf/wire';
import { McapIndexedReader, type McapTypes } from '@mcap/core';
import { decompress } from 'fzstd';
import type { MessageName } from './envelope';
import {
  ClaimLogSchema,
  JournalGapSchema,
  LessonRecordSchema,
  OverviewSchema,
  type JournalGap,
  type Overview,
} from './gen/proto/journal_pb';
import { OrganSchema } from './gen/proto/organ_pb';
import {
  ClaimOutcome,
  ParticipantsSchema,
  PointEventSchema,
  TeachAction,
  type ClaimEvent,
  type LessonStage,
  type Participants,
  type TeachEvent,
} from './gen/proto/wire_pb';

const kBlock = 64 * 1024,
  kBlocks = 256,
  kMostChunk = 64 * 1024 * 1024,
  kMostTicks = 1e9;
export const kDamaged =
  'This file is no whole Trocar recording: it is damaged, cut short, or something else.';
const kCutShort =
  'This recording was cut short and has no index: make it whole with "trocar-journal repair".';

export interface Bytes {
  size(): Promise<bigint>;
  read(offset: bigint, size: bigint): Promise<Uint8Array>;
  isSparse: boolean; // while it is, small parts from all over the file are read
}
export const traffic = { requests: 0, bytes: 0 };

// Loads whole blocks through `load`, each once as long as it is kept.
class Blocks implements Bytes {
  isSparse = false;
  private readonly kept = new Map<number, Promise<Uint8Array>>();
  constructor(
    private readonly length: number,
    private readonly load: (from: number, to: number) => Promise<Uint8Array>,
  ) {}
  size(): Promise<bigint> {
    return Promise.resolve(BigInt(this.length));
  }
  async read(offset: bigint, size: bigint): Promise<Uint8Array> {
    const from = Number(offset),
      length = Number(size);
    if (from < 0 || length < 0 || from + length > this.length) throw new Error(kDamaged);
    if (this.isSparse && length > 0 && length < kBlock / 2) return this.load(from, from + length);
    const out = new Uint8Array(length),
      first = Math.floor(from / kBlock),
      last = Math.floor((from + length - 1) / kBlock);
    const parts = await Promise.all(
      Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => this.block(first + i)),
    );
    parts.forEach((bytes, i) => {
      const at = (first + i) * kBlock,
        a = Math.max(from, at),
        z = Math.min(from + length, at + bytes.length);
      if (z > a) out.set(bytes.subarray(a - at, z - at), a - from);
    });
    return out;
  }
  private block(n: number): Promise<Uint8Array> {
    const known = this.kept.get(n);
    if (known) {
      this.kept.delete(n); // newest last
      this.kept.set(n, known);
      return known;
    }
    const loading = this.load(n * kBlock, Math.min((n + 1) * kBlock, this.length));
    loading.catch(() => this.kept.delete(n));
    this.kept.set(n, loading);
    const oldest = this.kept.keys().next().value;
    if (this.kept.size > kBlocks && oldest !== undefined) this.kept.delete(oldest);
    return loading;
  }
}

export async function overHttp(url: string, key: string): Promise<Bytes> {
  const headers = { Authorization: `Bearer ${key}` };
  const head = await fetch(url, { method: 'HEAD', headers });
  if (!head.ok)
    throw new Error(
      head.status === 403
        ? 'This link is good no more: ask for a new one.'
        : 'There is no such recording here.',
    );
  return new Blocks(Number(head.headers.get('content-length') ?? 0), async (from, to) => {
    const part = await fetch(url, { headers: { ...headers, Range: `bytes=${from}-${to - 1}` } });
    if (part.status !== 206)
      throw new Error('The recording cannot be loaded: is the server still there?');
    const bytes = new Uint8Array(await part.arrayBuffer());
    traffic.requests++;
    traffic.bytes += bytes.length;
    return bytes;
  });
}
export function ofFile(file: Blob): Bytes {
  return new Blocks(
    file.size,
    async (from, to) => new Uint8Array(await file.slice(from, to).arrayBuffer()),
  );
}

export interface Item {
  name: MessageName | null; // the field of Envelope that it would be; null: there is none
  tick: number;
  topic: string;
  data: Uint8Array;
}
export type EventKind =
  'people' | 'grant' | 'refusal' | 'end' | 'cut' | 'gap' | 'said' | 'note' | 'lesson';
export interface RecordedEvent {
  tick: number;
  kind: EventKind;
  text: string;
}

// The fields of Envelope for messages of a channel.
const kFields: Record<string, MessageName> = {
  '/surface/key': 'surfaceFrame',
  '/surface/delta': 'surfaceFrame',
  '/frame_state': 'frameState',
  '/topology/change': 'surfaceChange',
  '/topology': 'surfaceTopology',
  '/participants': 'participants',
  '/drawing': 'drawing',
};
const kEventTopics = ['/participants', '/claims', '/topology/change', '/gap', '/lesson'],
  kMostEvents = 5000;
// Ticks after which a cut is another one; an overview names one tick a second.
const kCutPause = 1500;
const kShown = [
  '/surface/delta',
  '/surface/key',
  '/topology',
  '/frame_state',
  '/drawing',
  ...kEventTopics,
];
// A Drawing without strokes, which replaces what was.
const kNothingDrawn = new Uint8Array([0x10, 0]);
type Message = McapTypes.TypedMcapRecords['Message'];

export class Recording {
  private constructor(
    private readonly reader: McapIndexedReader,
    private readonly readable: Bytes,
    readonly startNs: bigint,
    readonly firstTick: number,
    readonly lastTick: number,
    readonly organ: string,
    readonly bytes: number,
    private readonly protocolMinor: number,
  ) {}

  // Throws, with one sentence for people, if it is none.
  static async open(readable: Bytes): Promise<Recording> {
    const zstd = (packed: Uint8Array, size: bigint): Uint8Array => {
      if (size > BigInt(kMostChunk)) throw new Error(kDamaged);
      return decompress(packed, new Uint8Array(Number(size)));
    };
    try {
      const bytes = Number(await readable.size());
      const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd } });
      let start = reader.statistics?.messageStartTime ?? 0n,
        organ = '',
        minor = 0;
      for await (const m of reader.readMetadata({ name: 'trocar.session' })) {
        start = BigInt(m.metadata.get('start_utc_ns') ?? start);
        organ = m.metadata.get('organ_name') ?? '';
        minor = Number(m.metadata.get('protocol')?.split('.')[1] ?? 0);
      }
      const recording = new Recording(
        reader,
        readable,
        start,
        0,
        Number(((reader.statistics?.messageEndTime ?? start) - start) / 1_000_000n),
        organ,
        bytes,
        minor,
      );
      if (!(recording.lastTick >= 0 && recording.lastTick <= kMostTicks)) throw new Error(kDamaged);
      // A picture needs a keyframe: the first one is where the recording begins.
      let first = 0;
      for await (const m of reader.readMessages({ topics: ['/surface/key'] })) {
        first = recording.item(m).tick;
        break;
      }
      if (![...reader.channelsById.values()].some(channel => channel.topic === '/surface/key'))
        throw new Error(kDamaged);
      return new Recording(reader, readable, start, first, recording.lastTick, organ, bytes, minor);
    } catch (error) {
      const text = error instanceof Error ? error.message : '';
      if (/footer|Footer|trailing|not indexed|no index/.test(text)) throw new Error(kCutShort);
      throw text === '' || !/ recording| link /.test(text) ? new Error(kDamaged) : error;
    }
  }

  private time(tick: number): bigint {
    return this.startNs + BigInt(Math.max(0, Math.floor(tick))) * 1_000_000n;
  }
  private item(m: Message): Item {
    const topic = this.topic(m);
    return {
      name: kFields[topic] ?? null,
      tick: Number((m.logTime - this.startNs) / 1_000_000n),
      topic,
      data: m.data,
    };
  }
  private topic(m: Message): string {
    return this.reader.channelsById.get(m.channelId)?.topic ?? '';
  }
  private async last(topic: string, tick: number): Promise<Item | undefined> {
    for await (const m of this.reader.readMessages({
      topics: [topic],
      endTime: this.time(tick),
      reverse: true,
    }))
      return this.item(m);
    return undefined;
  }

  // Returns what a replica needs to show `tick`: people, surface, keyframe, and all after it up to
  // there.
  async seek(tick: number): Promise<Item[]> {
    const key = await this.last('/surface/key', tick),
      out: Item[] = [];
    if (!key) return out;
    out.push(
      (await this.last('/drawing', tick)) ?? {
        name: 'drawing',
        tick: key.tick,
        topic: '/drawing',
        data: kNothingDrawn,
      },
    );
    for (const before of [
      await this.last('/participants', tick),
      await this.last('/topology', key.tick),
      key,
    ])
      if (before) out.push(before);
    for await (const m of this.reader.readMessages({
      topics: ['/surface/delta', '/frame_state', '/topology/change'],
      startTime: this.time(key.tick),
      endTime: this.time(tick),
    })) {
      const item = this.item(m);
      const isOfSurface = item.name === 'surfaceFrame' || item.name === 'surfaceChange';
      if (!isOfSurface || item.tick > key.tick) out.push(item);
    }
    return out;
  }
  // Yields what comes after `tick`, in order.
  async *follow(tick: number): AsyncGenerator<Item> {
    let held: Item[] = [];
    for await (const m of this.reader.readMessages({
      topics: kShown,
      startTime: this.time(tick + 1),
    })) {
      const item = this.item(m);
      if (held[0] !== undefined && held[0].tick !== item.tick) {
        yield* shownOf(held);
        held = [];
      }
      held.push(item);
      if (item.topic === '/lesson') held.push(...this.pointing(m));
    }
    yield* shownOf(held);
  }
  // What the replica shows of a lesson besides the drawing.
  private *pointing(m: Message): Generator<Item> {
    const { entry } = fromBinary(LessonRecordSchema, m.data);
    if (entry.case === 'point')
      yield {
        name: 'pointEvent',
        tick: this.item(m).tick,
        topic: '/point',
        data: toBinary(PointEventSchema, entry.value),
      };
  }
  // The FineSurface of the organ, as a message; null: it has none. Before protocol 1.21 none has.
  async fineSurface(): Promise<Uint8Array | null> {
    if (this.protocolMinor < 21) return null;
    const organ = await this.last('/organ', this.firstTick);
    return organ && organ.data.length <= kMostChunk
      ? fieldIn(organ.data, OrganSchema.field.fineSurface!.number)
      : null;
  }
  // The overview, a message at a time; nothing in recordings that have none. It is small parts of
  // the file: an hour takes about a megabyte.
  async *overviews(): AsyncGenerator<Overview> {
    this.readable.isSparse = true;
    try {
      for await (const m of this.reader.readMessages({ topics: ['/overview'] }))
        yield readOverview(m.data);
    } finally {
      this.readable.isSparse = false;
    }
  }
  // What an overview holds, from the recording itself, after a tick: reads all of it.
  async *survey(after: number): AsyncGenerator<Item> {
    for await (const m of this.reader.readMessages({
      topics: [...kEventTopics, '/frame_state'],
      startTime: this.time(after + 1),
    }))
      yield this.item(m);
  }
}

// The last field of that number in a message, whose type is a message; null: it has none. Throws if
// it is no message.
function fieldIn(message: Uint8Array, field: number): Uint8Array | null {
  const reader = new BinaryReader(message);
  let found: Uint8Array | null = null;
  while (reader.pos < reader.len) {
    const [number, type] = reader.tag();
    if (number === field && type === WireType.LengthDelimited) found = reader.bytes();
    else reader.skip(type, number);
  }
  return found;
}

// Items of one tick. A keyframe says the same as a delta; where there is none, it replaces the
// surface.
function shownOf(items: Item[]): Item[] {
  if (!items.some(item => item.topic === '/surface/delta')) return items;
  return items.filter(item => item.topic !== '/surface/key' && item.topic !== '/topology');
}

export const kBadOverview = 'The overview of this recording cannot be read.';
function readOverview(data: Uint8Array): Overview {
  try {
    return fromBinary(OverviewSchema, data);
  } catch {
    throw new Error(kBadOverview);
  }
}

// Collects what happened, from whatever is read: items in the order of their ticks, or overviews.
// What is known is not added again.
export class EventLog {
  readonly events: RecordedEvent[] = [];
  readonly stages: { tick: number; stage: LessonStage }[] = []; // a lesson's stages, by tick
  readonly names = new Map<number, string>(); // by a participant's slot: the newest
  private readonly known = new Set<string>();
  private people: Participants | null = null;
  private peopleTick = -1;
  private lastCut = -1e9;

  addItem(item: Item): void {
    if (item.topic === '/participants')
      this.addPeople(item.tick, fromBinary(ParticipantsSchema, item.data));
    else if (item.topic === '/claims')
      for (const event of fromBinary(ClaimLogSchema, item.data).event) this.addClaim(event);
    else if (item.topic === '/gap') this.addGap(fromBinary(JournalGapSchema, item.data));
    else if (item.topic === '/topology/change') this.addCut(item.tick);
    else if (item.topic === '/lesson') {
      const { entry } = fromBinary(LessonRecordSchema, item.data);
      if (entry.case === 'teach') this.addLesson(entry.value);
      if (entry.case === 'stage') this.addStage(item.tick, entry.value);
    }
  }
  // The stage that was on at a tick; null: none was yet.
  stageAt(tick: number): LessonStage | null {
    return this.stages.findLast(told => told.tick <= tick)?.stage ?? null;
  }
  addOverview(overview: Overview): void {
    for (const { tick, participants } of overview.presence)
      if (participants) this.addPeople(Number(tick), participants);
    overview.claim.forEach(event => this.addClaim(event));
    overview.gap.forEach(gap => this.addGap(gap));
    overview.lesson.forEach(event => this.addLesson(event));
    for (const { tick, stage } of overview.stage) if (stage) this.addStage(Number(tick), stage);
    overview.changeTick.forEach(tick => this.addCut(Number(tick)));
    if (overview.leftOut > 0)
      this.add({
        tick: Number(overview.firstTick),
        kind: 'gap',
        text: `${overview.leftOut} events had no room in the overview`,
      });
  }

  private addPeople(tick: number, now: Participants): void {
    if (tick < this.peopleTick) return;
    for (const text of changesOf(this.people, now)) this.add({ tick, kind: 'people', text });
    for (const p of now.participant) this.names.set(p.slot, p.name);
    this.people = now;
    this.peopleTick = tick;
  }
  private addClaim(event: ClaimEvent): void {
    this.add({ tick: Number(event.tick), kind: kindOf(event.outcome), text: event.text });
  }
  private addLesson(event: TeachEvent): void {
    this.add({ tick: Number(event.tick), kind: kindOfTeaching(event.action), text: event.text });
  }
  private addStage(tick: number, stage: LessonStage): void {
    const key = `${tick} stage ${stage.stage} ${stage.beginTick} ${stage.hint} ${stage.isOver}`;
    if (this.known.has(key) || this.stages.length >= kMostEvents) return;
    this.known.add(key);
    const before = this.stageAt(tick),
      isNew =
        before === null || before.stage !== stage.stage || before.beginTick !== stage.beginTick;
    let at = this.stages.length;
    while (at > 0 && (this.stages[at - 1]?.tick ?? 0) > tick) at--;
    this.stages.splice(at, 0, { tick, stage });
    if (stage.isOver)
      this.add({
        tick,
        kind: 'lesson',
        text: `The lesson is over: ${stage.points.toFixed(0)} of 100 points`,
      });
    else if (isNew)
      this.add({
        tick,
        kind: 'lesson',
        text: `Stage ${stage.stage + 1} of ${stage.stages}: ${stage.name}`,
      });
  }
  private addGap(gap: JournalGap): void {
    const text = gap.isJoin
      ? 'Another server went on here'
      : `${gap.messages} messages are missing here`;
    this.add({ tick: Number(gap.firstTick), kind: 'gap', text });
  }
  private addCut(tick: number): void {
    if (tick - this.lastCut > kCutPause || tick < this.lastCut)
      this.add({ tick, kind: 'cut', text: 'Tissue is cut or tears' });
    this.lastCut = tick;
  }
  private add(event: RecordedEvent): void {
    const key = `${event.tick} ${event.kind} ${event.text}`;
    if (event.text === '' || this.known.has(key) || this.events.length >= kMostEvents) return;
    this.known.add(key);
    let at = this.events.length;
    while (at > 0 && (this.events[at - 1]?.tick ?? 0) > event.tick) at--;
    this.events.splice(at, 0, event);
  }
}

export function kindOf(outcome: ClaimOutcome): EventKind {
  switch (outcome) {
    case ClaimOutcome.CLAIM_GRANTED:
      return 'grant';
    case ClaimOutcome.CLAIM_REFUSED_HELD:
    case ClaimOutcome.CLAIM_REFUSED_NOTHING_IN_REACH:
      return 'refusal';
    default:
      return 'end';
  }
}

export function kindOfTeaching(action: TeachAction): EventKind {
  return action === TeachAction.TEACH_CHAT
    ? 'said'
    : action === TeachAction.TEACH_NOTE
      ? 'note'
      : 'lesson';
}

// Who came, went, broke off and came back.
export function changesOf(before: Participants | null, now: Participants): string[] {
  const out: string[] = [],
    known = new Map((before?.participant ?? []).map(p => [p.slot, p]));
  for (const p of now.participant) {
    const was = known.get(p.slot);
    known.delete(p.slot);
    if (!was) out.push(`${p.name} has joined`);
    else if (was.name !== p.name) out.push(`${was.name} is now ${p.name}`);
    else if (was.isAway !== p.isAway)
      out.push(p.isAway ? `${p.name} has lost the connection` : `${p.name} is back`);
  }
  for (const gone of known.values()) out.push(`${gone.name} has left`);
  return before === null && now.participant.length > 3
    ? [`${now.participant.length} people are here`]
    : out;
}
