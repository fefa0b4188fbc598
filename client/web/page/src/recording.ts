// A recording, over HTTP ranges or from a dropped file. Only what is shown is loaded: whole blocks,
// of which the last ones used are kept.

import { fromBinary, toBinary } from '@bufbuild/protobuf';
import { McapIndexedReader, type McapTypes } from '@mcap/core';
import { decompress } from 'fzstd';
import { ClaimLogSchema, JournalGapSchema, LessonRecordSchema } from './gen/proto/journal_pb';
import { ClaimOutcome, FrameStateSchema, ParticipantsSchema, PointEventSchema, TeachAction, type FrameState, type Participants } from './gen/proto/wire_pb';

const kBlock = 64 * 1024, kBlocks = 256, kMostChunk = 64 * 1024 * 1024;
export const kDamaged = 'This file is no whole Trocar recording: it is damaged, cut short, or something else.';
const kCutShort = 'This recording was cut short and has no index: make it whole with "trocar-journal repair".';

export interface Bytes { size(): Promise<bigint>; read(offset: bigint, size: bigint): Promise<Uint8Array> }
export const traffic = { requests: 0, bytes: 0 };

// Loads whole blocks through `load`, each once as long as it is kept.
class Blocks implements Bytes {
  private readonly kept = new Map<number, Promise<Uint8Array>>();
  constructor(private readonly length: number, private readonly load: (from: number, to: number) => Promise<Uint8Array>) {}
  size(): Promise<bigint> { return Promise.resolve(BigInt(this.length)); }
  async read(offset: bigint, size: bigint): Promise<Uint8Array> {
    const from = Number(offset), length = Number(size);
    if (from < 0 || length < 0 || from + length > this.length) throw new Error(kDamaged);
    const out = new Uint8Array(length), first = Math.floor(from / kBlock), last = Math.floor((from + length - 1) / kBlock);
    const parts = await Promise.all(Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => this.block(first + i)));
    parts.forEach((bytes, i) => {
      const at = (first + i) * kBlock, a = Math.max(from, at), z = Math.min(from + length, at + bytes.length);
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
  if (!head.ok) throw new Error(head.status === 403 ? 'This link is good no more: ask for a new one.' : 'There is no such recording here.');
  return new Blocks(Number(head.headers.get('content-length') ?? 0), async (from, to) => {
    const part = await fetch(url, { headers: { ...headers, Range: `bytes=${from}-${to - 1}` } });
    if (part.status !== 206) throw new Error('The recording cannot be loaded: is the server still there?');
    const bytes = new Uint8Array(await part.arrayBuffer());
    traffic.requests++;
    traffic.bytes += bytes.length;
    return bytes;
  });
}
export function ofFile(file: Blob): Bytes {
  return new Blocks(file.size, async (from, to) => new Uint8Array(await file.slice(from, to).arrayBuffer()));
}

export interface Item { field: number; tick: number; data: Uint8Array }
export type EventKind = 'people' | 'grant' | 'refusal' | 'end' | 'cut' | 'gap' | 'said' | 'note' | 'lesson';
export interface RecordedEvent { tick: number; kind: EventKind; text: string }

// Fields of Envelope, by channel.
const kFields: Record<string, number> = { '/surface/key': 2, '/surface/delta': 2, '/frame_state': 3, '/topology/change': 8, '/topology': 18, '/participants': 19, '/drawing': 40 };
const kShown = ['/surface/delta', '/frame_state', '/topology/change', '/participants', '/drawing', '/lesson'];
const kNothingDrawn = new Uint8Array([0x10, 0]); // a Drawing without strokes, which replaces what was
type Message = McapTypes.TypedMcapRecords['Message'];

export class Recording {
  private constructor(private readonly reader: McapIndexedReader, private readonly startNs: bigint, readonly firstTick: number, readonly lastTick: number, readonly organ: string, readonly bytes: number) {}

  // Throws, with one sentence for people, if it is none.
  static async open(readable: Bytes): Promise<Recording> {
    const zstd = (packed: Uint8Array, size: bigint): Uint8Array => {
      if (size > BigInt(kMostChunk)) throw new Error(kDamaged);
      return decompress(packed, new Uint8Array(Number(size)));
    };
    try {
      const bytes = Number(await readable.size());
      const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd } });
      let start = reader.statistics?.messageStartTime ?? 0n, organ = '';
      for await (const m of reader.readMetadata({ name: 'trocar.session' })) {
        start = BigInt(m.metadata.get('start_utc_ns') ?? start);
        organ = m.metadata.get('organ_name') ?? '';
      }
      const recording = new Recording(reader, start, 0, Number(((reader.statistics?.messageEndTime ?? start) - start) / 1_000_000n), organ, bytes);
      // A picture needs a keyframe: the first one is where the recording begins.
      let first = 0;
      for await (const m of reader.readMessages({ topics: ['/surface/key'] })) { first = recording.item(m).tick; break; }
      if (![...reader.channelsById.values()].some(channel => channel.topic === '/surface/key')) throw new Error(kDamaged);
      return new Recording(reader, start, first, recording.lastTick, organ, bytes);
    } catch (error) {
      const text = error instanceof Error ? error.message : '';
      if (/footer|Footer|trailing|not indexed|no index/.test(text)) throw new Error(kCutShort);
      throw text === '' || !/ recording| link /.test(text) ? new Error(kDamaged) : error;
    }
  }

  private time(tick: number): bigint { return this.startNs + BigInt(Math.max(0, Math.floor(tick))) * 1_000_000n; }
  private item(m: Message): Item { return { field: kFields[this.topic(m)] ?? 0, tick: Number((m.logTime - this.startNs) / 1_000_000n), data: m.data }; }
  private topic(m: Message): string { return this.reader.channelsById.get(m.channelId)?.topic ?? ''; }
  private async last(topic: string, tick: number): Promise<Item | undefined> {
    for await (const m of this.reader.readMessages({ topics: [topic], endTime: this.time(tick), reverse: true })) return this.item(m);
    return undefined;
  }

  // Returns what a replica needs to show `tick`: people, surface, keyframe, and all after it up to there.
  async seek(tick: number): Promise<Item[]> {
    const key = await this.last('/surface/key', tick), out: Item[] = [];
    if (!key) return out;
    out.push(await this.last('/drawing', tick) ?? { field: 40, tick: key.tick, data: kNothingDrawn });
    for (const before of [await this.last('/participants', tick), await this.last('/topology', key.tick), key]) if (before) out.push(before);
    for await (const m of this.reader.readMessages({ topics: ['/surface/delta', '/frame_state', '/topology/change'], startTime: this.time(key.tick), endTime: this.time(tick) })) {
      const item = this.item(m);
      const isOfSurface = item.field === 2 || item.field === 8;
      if (!isOfSurface || item.tick > key.tick) out.push(item);
    }
    return out;
  }
  // Yields what comes after `tick`, in order.
  async *follow(tick: number): AsyncGenerator<Item> {
    for await (const m of this.reader.readMessages({ topics: kShown, startTime: this.time(tick + 1) })) {
      if (this.topic(m) !== '/lesson') yield this.item(m);
      else yield* this.pointing(m);
    }
  }
  // What the replica shows of a lesson besides the drawing.
  private *pointing(m: Message): Generator<Item> {
    const { entry } = fromBinary(LessonRecordSchema, m.data);
    if (entry.case === 'point') yield { field: 36, tick: this.item(m).tick, data: toBinary(PointEventSchema, entry.value) };
  }
  // Forces over all of it, a frame at a time.
  async *states(from: number, to: number): AsyncGenerator<{ tick: number; state: FrameState }> {
    for await (const m of this.reader.readMessages({ topics: ['/frame_state'], startTime: this.time(from), endTime: this.time(to) }))
      yield { tick: this.item(m).tick, state: fromBinary(FrameStateSchema, m.data) };
  }

  // Everything that happened, in order.
  async events(): Promise<RecordedEvent[]> {
    const out: RecordedEvent[] = [];
    let people: Participants | null = null, lastCut = -1e9;
    for await (const m of this.reader.readMessages({ topics: ['/participants', '/claims', '/topology/change', '/gap', '/lesson'] })) {
      const tick = this.item(m).tick, topic = this.topic(m);
      if (topic === '/participants') {
        const now = fromBinary(ParticipantsSchema, m.data);
        out.push(...changesOf(people, now).map(text => ({ tick, kind: 'people' as const, text })));
        people = now;
      } else if (topic === '/claims') {
        for (const event of fromBinary(ClaimLogSchema, m.data).event) out.push({ tick: Number(event.tick), kind: kindOf(event.outcome), text: event.text });
      } else if (topic === '/lesson') {
        const { entry } = fromBinary(LessonRecordSchema, m.data);
        if (entry.case === 'teach') out.push({ tick: Number(entry.value.tick), kind: kindOfTeaching(entry.value.action), text: entry.value.text });
      } else if (topic === '/gap') {
        out.push({ tick, kind: 'gap', text: `${fromBinary(JournalGapSchema, m.data).messages} messages are missing here` });
      } else {
        if (tick - lastCut > 1000) out.push({ tick, kind: 'cut', text: 'Tissue is cut or tears' });
        lastCut = tick;
      }
      if (out.length > 5000) break;
    }
    return out.filter(event => event.text !== '');
  }
}

export function kindOf(outcome: ClaimOutcome): EventKind {
  switch (outcome) {
    case ClaimOutcome.CLAIM_GRANTED: return 'grant';
    case ClaimOutcome.CLAIM_REFUSED_HELD:
    case ClaimOutcome.CLAIM_REFUSED_NOTHING_IN_REACH: return 'refusal';
    default: return 'end';
  }
}

export function kindOfTeaching(action: TeachAction): EventKind {
  return action === TeachAction.TEACH_CHAT ? 'said' : action === TeachAction.TEACH_NOTE ? 'note' : 'lesson';
}

// Who came, went, broke off and came back.
export function changesOf(before: Participants | null, now: Participants): string[] {
  const out: string[] = [], known = new Map((before?.participant ?? []).map(p => [p.slot, p]));
  for (const p of now.participant) {
    const was = known.get(p.slot);
    known.delete(p.slot);
    if (!was) out.push(`${p.name} has joined`);
    else if (was.name !== p.name) out.push(`${was.name} is now ${p.name}`);
    else if (was.isAway !== p.isAway) out.push(p.isAway ? `${p.name} has lost the connection` : `${p.name} is back`);
  }
  for (const gone of known.values()) out.push(`${gone.name} has left`);
  return before === null && now.participant.length > 3 ? [`${now.participant.length} people are here`] : out;
}
