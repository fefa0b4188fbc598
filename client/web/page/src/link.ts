// A link names session, role and code behind its #, which no browser sends to a server.

export interface Link {
  code: string; // empty: not given
  role: 'instructor' | 'observer';
  name: string;
  session: string; // "HOST:PORT" of one of several; empty: the first
  recordingsKey: string;
  file: string; // of the recordings
  seconds: number | null; // where in it to begin
}

const kName = 'trocar-name';

export function readLink(hash: string): Link {
  const given = new URLSearchParams(hash.replace(/^#/, ''));
  const seconds = Number(given.get('t') ?? 'none');
  return {
    code: given.get('join') === 'CODE' ? '' : given.get('join') ?? '',
    role: given.get('role') === 'instructor' ? 'instructor' : 'observer',
    name: given.get('name') ?? rememberedName(),
    session: given.get('session') ?? '',
    recordingsKey: given.get('recordings') ?? '',
    file: given.get('file') ?? '',
    seconds: Number.isFinite(seconds) && seconds >= 0 ? seconds : null,
  };
}

export function recordingLink(key: string, file: string, seconds: number): string {
  const what = new URLSearchParams({ recordings: key, file, t: seconds.toFixed(2) });
  return `${location.origin}${location.pathname}#${what}`;
}

function rememberedName(): string {
  try { return localStorage.getItem(kName) ?? ''; } catch { return ''; }
}
export function rememberName(name: string): void {
  try { localStorage.setItem(kName, name); } catch { /* a browser that keeps nothing: it is asked again */ }
}

// 1 to 32 bytes, as the server wants it; a line that says what is wrong, or nothing.
export function nameFault(name: string): string {
  const bytes = new TextEncoder().encode(name).length;
  if (bytes === 0) return 'Type a name, so that the others know who watches.';
  if (bytes > 32) return 'The name is too long: 32 letters at most.';
  return '';
}
