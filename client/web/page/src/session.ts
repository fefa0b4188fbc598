// A live session over a WebSocket: joins, keeps the replica fed, measures how old the picture is,
// and comes back when the connection breaks.

import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import {
  EnvelopeSchema,
  GoodbyeReason,
  LessonRequestSchema,
  MarkRequestSchema,
  PointRequestSchema,
  StrokeRequestSchema,
  TeachAction,
  TeachRequestSchema,
  ToolChangeSchema,
  ToolSampleSchema,
  Vec3Schema,
  ViewRequestSchema,
  type Envelope,
  type LessonAction,
  type MarkAction,
  type Participant,
  type ToolShape,
  type Verb,
} from './gen/proto/wire_pb';
import { firstNumber, numberOf, type MessageName } from './envelope';
import type { Link } from './link';
import type { HandSample, Replica, Vec3 } from './replica';

export type State = 'joining' | 'live' | 'away' | 'ended';
export interface View {
  eye: Vec3;
  target: Vec3;
} // m
export interface Hooks {
  // Every message that is not of the surface; `tick` of the session when it came.
  onMessage(message: Envelope, tick: number): void;
  onChange(): void; // `state` or `why` has changed
}

const kPingMs = 1000,
  kSilenceMs = 4000,
  kRoundTrips = 16;
// A server that is busy may take long to let somebody in, and one that has just begun may not hear
// yet.
const kJoinSilenceMs = 15_000,
  kJoinTries = 4;
// The replica alone reads such messages: the page does not parse them.
const kOfReplica: MessageName[] = [
  'surfaceFrame',
  'frameState',
  'surfaceChange',
  'surfaceTopology',
  'surfaceSlice',
  'frameStatePart',
  'datagramProbe',
  'hapticPatches',
  'hapticLaw',
  'pointEvent',
  'drawing',
  'fineSurfacePart',
];
const kNumbersOfReplica = new Set(kOfReplica.map(numberOf));

export class Session {
  state: State = 'joining';
  why = ''; // one line for people, when it is away or has ended
  refusal: GoodbyeReason | null = null;
  bytes = 0;
  roundTripMs = 0;
  awaySince = 0;
  lastView: View | null = null; // the view to follow
  onView: (view: View) => void = () => undefined;
  private keepSeconds = 0;
  private socket: WebSocket | null = null;
  private token = '';
  private heardMs = 0;
  private offsets: { roundTrip: number; offset: number }[] = [];
  private timer = 0;
  private retryMs = 200;
  private joinTries = 0;
  private hasLeft = false;
  private samples = 0;

  constructor(
    private readonly link: Link,
    private readonly replica: Replica,
    private readonly hooks: Hooks,
    private readonly tools: string[] = [], // names of the instruments that one joins with
  ) {
    this.connect();
    this.timer = window.setInterval(() => this.tick(), kPingMs);
    window.addEventListener('pagehide', this.leave);
    window.addEventListener('online', this.retryNow);
  }

  // How old the newest frame is, in ms by the server's clock; nothing while that is unknown.
  get newestAgeMs(): number | null {
    const published = this.replica.newestServerUs,
      offset = this.offset;
    return published === 0 || offset === null
      ? null
      : (performance.now() * 1000 + offset - published) / 1000;
  }
  // The same for the picture that is shown, some frames after the newest.
  get shownAgeMs(): number | null {
    const age = this.newestAgeMs;
    return age === null
      ? null
      : age + Math.max(0, this.replica.newestTick - this.replica.shownTick);
  }
  // Beyond this the picture is old: half a round trip, three frames and 250 ms.
  get oldAfterMs(): number {
    return this.roundTripMs / 2 + 48 + 250;
  }

  // Marks the organ, or returns it; `name`: of several marks.
  mark(action: MarkAction, name: string): void {
    this.say({ case: 'markRequest', value: create(MarkRequestSchema, { action, name }) });
  }

  // Shows everybody a point (m), or none any more.
  point(place: Vec3 | null): void {
    const positionM =
      place === null
        ? {}
        : { positionM: create(Vec3Schema, { x: place[0], y: place[1], z: place[2] }) };
    this.say({ case: 'pointRequest', value: create(PointRequestSchema, positionM) });
  }

  // What an instructor does; `whom`: with whom, `text`: what the action needs.
  teach(action: TeachAction, whom: Participant | null = null, text = ''): void {
    this.say({
      case: 'teachRequest',
      value: create(TeachRequestSchema, {
        action,
        text,
        participant: whom?.slot ?? 0,
        name: whom?.name ?? '',
      }),
    });
  }
  // One's tool and a free one of the receiver change hands, with what it holds.
  handOver(giver: Participant, tool: number, receiver: Participant): void {
    this.say({
      case: 'teachRequest',
      value: create(TeachRequestSchema, {
        action: TeachAction.TEACH_HAND_OVER,
        participant: giver.slot,
        name: giver.name,
        tool,
        receiver: receiver.slot,
        receiverName: receiver.name,
      }),
    });
  }
  // Goes on in the lesson, or back to its beginning, or answers with a tool, 0 or 1.
  lead(action: LessonAction, tool = 0): void {
    this.say({ case: 'lessonRequest', value: create(LessonRequestSchema, { action, tool }) });
  }
  // Lets simulated time go so fast, as a share of real time.
  slow(rate: number): void {
    this.say({
      case: 'teachRequest',
      value: create(TeachRequestSchema, { action: TeachAction.TEACH_SLOW, rate }),
    });
  }
  // A line on the organ, or a piece of it.
  stroke(points: { triangle: number; weights: [number, number] }[]): void {
    this.say({
      case: 'strokeRequest',
      value: create(StrokeRequestSchema, {
        triangle: points.map(p => p.triangle),
        weight: points.flatMap(p => p.weights),
      }),
    });
  }
  // Says where a hand has its tool, 0 or 1, and what it asks of it. No force comes back here.
  sample(tool: number, hand: HandSample): void {
    const [x, y, z] = hand.tip,
      [qx, qy, qz, qw] = hand.orientation;
    this.say({
      case: 'toolSample',
      value: create(ToolSampleSchema, {
        tool,
        sequence: ++this.samples,
        positionM: { x, y, z },
        orientation: { x: qx, y: qy, z: qz, w: qw },
        verb: hand.verb as number as Verb,
      }),
    });
  }
  // The hand takes another instrument.
  change(tool: number, shape: ToolShape): void {
    this.say({ case: 'toolChange', value: create(ToolChangeSchema, { tool, shape }) });
  }
  // Says where this person's view is, which others follow.
  view(eye: Vec3, target: Vec3): void {
    const place = (v: Vec3) => create(Vec3Schema, { x: v[0], y: v[1], z: v[2] });
    this.say({
      case: 'viewRequest',
      value: create(ViewRequestSchema, { eyeM: place(eye), targetM: place(target) }),
    });
  }

  leave = (): void => {
    if (this.hasLeft) return;
    this.hasLeft = true;
    window.clearInterval(this.timer);
    window.removeEventListener('pagehide', this.leave);
    window.removeEventListener('online', this.retryNow);
    this.socket?.close(1000);
    this.end('You have left the session.');
  };

  private get offset(): number | null {
    const best = this.offsets.reduce<{ roundTrip: number; offset: number } | null>(
      (a, b) => (a === null || b.roundTrip < a.roundTrip ? b : a),
      null,
    );
    return best === null ? null : best.offset;
  }

  private connect(): void {
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = new WebSocket(`${scheme}://${location.host}/session`);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.heardMs = performance.now();
    socket.onopen = () => {
      const { code, name, role, session } = this.link;
      const { token, tools } = this;
      socket.send(
        JSON.stringify({
          code,
          name,
          role,
          session,
          token,
          ...(tools.length > 0 ? { tools } : {}),
        }),
      );
    };
    socket.onmessage = event => {
      if (socket === this.socket && event.data instanceof ArrayBuffer)
        this.take(new Uint8Array(event.data));
    };
    socket.onclose = () => {
      if (socket === this.socket) this.lost('The connection broke.');
    };
  }

  private take(bytes: Uint8Array): void {
    const now = performance.now();
    this.heardMs = now;
    this.bytes += bytes.length;
    try {
      this.replica.receive(bytes, now);
      for (const answer of this.replica.takeOutbox()) this.send(answer);
      if (!kNumbersOfReplica.has(firstNumber(bytes)))
        this.heed(fromBinary(EnvelopeSchema, bytes), now);
    } catch (error) {
      this.end(`This page cannot go on: ${error instanceof Error ? error.message : String(error)}`);
      this.socket?.close(1000);
    }
  }

  private heed(message: Envelope, now: number): void {
    const { case: kind, value } = message.message;
    if (kind === 'pong') {
      const roundTrip = now - Number(value.clientTimeUs) / 1000;
      this.roundTripMs = roundTrip;
      if (value.serverTimeUs > 0n) {
        this.offsets.push({
          roundTrip,
          offset: Number(value.serverTimeUs) - (now - roundTrip / 2) * 1000,
        });
        if (this.offsets.length > kRoundTrips) this.offsets.shift();
      }
      return;
    }
    if (kind === 'welcome') {
      this.token = Array.from(value.returnToken, b => b.toString(16).padStart(2, '0')).join('');
      this.keepSeconds = value.returnSeconds;
      this.retryMs = 200;
      this.offsets = [];
      this.set('live', '');
      this.ping();
    }
    if (kind === 'viewEvent' && value.eyeM && value.targetM) {
      this.lastView = {
        eye: [value.eyeM.x, value.eyeM.y, value.eyeM.z],
        target: [value.targetM.x, value.targetM.y, value.targetM.z],
      };
      this.onView(this.lastView);
    }
    if (kind === 'goodbye') {
      // A seat that hangs on the connection before is free in a moment.
      const comesBack = this.state === 'away' && value.reason === GoodbyeReason.GOODBYE_TIMEOUT;
      if (!comesBack) {
        this.refusal = value.reason;
        this.end(value.text || 'The session has ended.');
      }
    }
    this.hooks.onMessage(message, Math.max(0, this.replica.newestTick));
  }

  private lost(why: string): void {
    this.socket = null;
    if (this.state === 'ended') return;
    if (this.state === 'joining') {
      if (++this.joinTries >= kJoinTries)
        return this.end('The server does not answer: is it running, and is the link right?');
      return this.retryLater();
    }
    const now = performance.now();
    if (this.state !== 'away') this.awaySince = now;
    if (now - this.awaySince > (this.keepSeconds + 5) * 1000)
      return this.end('The connection was lost for too long. Open the link again.');
    this.set('away', why);
    this.retryLater();
  }
  private retryLater(): void {
    window.setTimeout(this.retryNow, this.retryMs);
    this.retryMs = Math.min(2000, this.retryMs * 2);
  }
  private retryNow = (): void => {
    if (this.state !== 'live' && this.state !== 'ended' && this.socket === null) this.connect();
  };

  private tick(): void {
    if (this.socket === null) return;
    const patience = this.state === 'joining' ? kJoinSilenceMs : kSilenceMs;
    if (performance.now() - this.heardMs > patience && this.state !== 'ended') {
      const silent = this.socket;
      this.lost('Nothing has come for too long.');
      silent.close(4000); // not in order: the session keeps the seat
      return;
    }
    if (this.state === 'live') this.ping();
  }
  private ping(): void {
    this.say({
      case: 'ping',
      value: {
        $typeName: 'trocar.proto.Ping',
        clientTimeUs: BigInt(Math.round(performance.now() * 1000)),
      },
    });
  }
  private say(message: Envelope['message']): void {
    const envelope = create(EnvelopeSchema);
    envelope.message = message;
    this.send(toBinary(EnvelopeSchema, envelope));
  }
  private send(bytes: Uint8Array): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(new Uint8Array(bytes));
  }
  private end(why: string): void {
    if (this.state !== 'ended') this.set('ended', why);
  }
  private set(state: State, why: string): void {
    this.state = state;
    this.why = why;
    this.hooks.onChange();
  }
}
