// Bookmarks of a recording: named moments, kept in this browser, passed on in a link or a file.

export interface Bookmark {
  tick: number;
  name: string;
}

export const kMostBookmarks = 200,
  kMostName = 80;
const kMostText = 64 * 1024,
  kMostTick = 1e9;

// The same list, in order, as text for a link or a file: [[seconds, name], ...].
export const bookmarksText = (marks: Bookmark[]): string =>
  JSON.stringify(marks.map(m => [m.tick / 1000, m.name]));

// Throws, with one line for people, if the text is no list of bookmarks.
export function readBookmarks(text: string): Bookmark[] {
  const wrong = (why: string): Error => new Error(`These are no bookmarks: ${why}.`);
  if (text.length > kMostText) throw wrong('the text is too long');
  let list: unknown;
  try {
    list = JSON.parse(text);
  } catch {
    throw wrong('they are not written as JSON');
  }
  if (!Array.isArray(list)) throw wrong('a list of times and names is needed');
  if (list.length > kMostBookmarks) throw wrong(`there are more than ${kMostBookmarks}`);
  const marks = list.map((entry: unknown): Bookmark => {
    const [seconds, name] = Array.isArray(entry) ? (entry as unknown[]) : [];
    if (
      typeof seconds !== 'number' ||
      !Number.isFinite(seconds) ||
      seconds < 0 ||
      seconds * 1000 > kMostTick
    )
      throw wrong('a time is missing');
    if (typeof name !== 'string' || name.trim() === '' || name.length > kMostName)
      throw wrong(`a name has 1 to ${kMostName} letters`);
    return { tick: Math.round(seconds * 1000), name: name.trim() };
  });
  return sorted(marks);
}

// Both lists; what is in both once.
export function joined(a: Bookmark[], b: Bookmark[]): Bookmark[] {
  const known = new Map([...a, ...b].map(m => [`${m.tick} ${m.name}`, m]));
  return sorted([...known.values()]).slice(0, kMostBookmarks);
}
const sorted = (marks: Bookmark[]): Bookmark[] => [...marks].sort((a, b) => a.tick - b.tick);

// A recording is known by its start, to the nanosecond.
const keyOf = (start: bigint): string => `trocar-bookmarks-${start}`;
export function keptBookmarks(start: bigint): Bookmark[] {
  try {
    return readBookmarks(localStorage.getItem(keyOf(start)) ?? '[]');
  } catch {
    return [];
  }
}
// Returns false in a browser that keeps nothing.
export function keepBookmarks(start: bigint, marks: Bookmark[]): boolean {
  try {
    if (marks.length === 0) localStorage.removeItem(keyOf(start));
    else localStorage.setItem(keyOf(start), bookmarksText(marks));
    return true;
  } catch {
    return false;
  }
}
