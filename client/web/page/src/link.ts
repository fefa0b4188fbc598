// A link names session, role and code behind its #, which no browser sends to a server.

export const kRoles = ['observer', 'surgeon', 'assistant', 'instructor'] as const;
export type Role = (typeof kRoles)[number];
// Whether one of that role holds instruments here.
export const holdsTools = (role: Role): boolean => role === 'surgeon' || role === 'assistant';

export interface Link {
  code: string; // empty: not given
  role: Role;
  name: string;
  session: string; // "HOST:PORT" of one of several; empty: the first
  recordingsKey: string;
  practiceKey: string; // empty: it is no link to practise alone
  file: string; // one of the recordings
  seconds: number | null; // where in it to begin
  view: View | null;
  speed: number | null;
  bookmarks: string; // readBookmarks reads them; empty: none
}

// From where the picture is seen, m.
export interface View {
  eye: [number, number, number];
  target: [number, number, number];
}

const kName = 'trocar-name',
  kFarthest = 5;

// Six numbers; null if they cannot be a view.
function readView(text: string | null): View | null {
  const n = (text ?? '').split(',').map(Number);
  if (n.length !== 6 || n.some(x => !Number.isFinite(x) || Math.abs(x) > kFarthest)) return null;
  const [a = 0, b = 0, c = 0, d = 0, e = 0, f = 0] = n;
  return Math.hypot(a - d, b - e, c - f) < 1e-3 ? null : { eye: [a, b, c], target: [d, e, f] };
}
const writeView = (view: View): string =>
  [...view.eye, ...view.target].map(x => x.toFixed(4)).join(',');

export function readLink(hash: string): Link {
  const given = new URLSearchParams(hash.replace(/^#/, ''));
  const seconds = Number(given.get('t') ?? 'none'),
    speed = Number(given.get('speed') ?? 'none');
  return {
    code: given.get('join') === 'CODE' ? '' : (given.get('join') ?? ''),
    role: kRoles.find(role => role === given.get('role')) ?? 'observer',
    name: given.get('name') ?? rememberedName(),
    session: given.get('session') ?? '',
    recordingsKey: given.get('recordings') ?? '',
    practiceKey: given.get('practice') ?? '',
    file: given.get('file') ?? '',
    seconds: Number.isFinite(seconds) && seconds >= 0 ? seconds : null,
    view: readView(given.get('view')),
    speed: Number.isFinite(speed) && speed > 0 ? speed : null,
    bookmarks: given.get('bookmarks') ?? '',
  };
}

// What a link to a recording may say besides its time.
export interface Moment {
  seconds: number;
  view?: View | null;
  speed?: number;
  bookmarks?: string;
}
export function recordingLink(key: string, file: string, moment: Moment): string {
  const what = new URLSearchParams({ recordings: key, file, t: moment.seconds.toFixed(2) });
  if (moment.view) what.set('view', writeView(moment.view));
  if (moment.speed && moment.speed !== 1) what.set('speed', String(moment.speed));
  if (moment.bookmarks) what.set('bookmarks', moment.bookmarks);
  return `${location.origin}${location.pathname}#${what}`;
}

function rememberedName(): string {
  try {
    return localStorage.getItem(kName) ?? '';
  } catch {
    return '';
  }
}
export function rememberName(name: string): void {
  try {
    localStorage.setItem(kName, name);
  } catch {
    /* a browser that keeps nothing: it is asked again */
  }
}

// 1 to 32 bytes, as the server wants it; a line that says what is wrong, or nothing.
export function nameFault(name: string): string {
  const bytes = new TextEncoder().encode(name).length;
  if (bytes === 0) return 'Type a name, so that the others know who watches.';
  if (bytes > 32) return 'The name is too long: 32 letters at most.';
  return '';
}
