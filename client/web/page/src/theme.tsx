// Light or dark: as the browser is set, until somebody chooses; the choice is remembered.

import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';

type Theme = 'light' | 'dark';
const kKey = 'trocar.theme',
  system = window.matchMedia('(prefers-color-scheme: light)');

function chosen(): Theme | null {
  try {
    const kept = localStorage.getItem(kKey);
    return kept === 'light' || kept === 'dark' ? kept : null;
  } catch {
    return null; // this browser keeps nothing
  }
}
const told = new Set<() => void>();
let now: Theme;
function apply(theme: Theme): void {
  now = theme;
  document.documentElement.dataset['theme'] = theme;
  for (const tell of told) tell();
}
apply(chosen() ?? (system.matches ? 'light' : 'dark'));
system.addEventListener('change', () => {
  if (chosen() === null) apply(system.matches ? 'light' : 'dark');
});

// Also draws anew what it is used in when that changes.
export function useTheme(): Theme {
  const [, redraw] = useState(0);
  useEffect(() => {
    const tell = (): void => redraw(n => n + 1);
    told.add(tell);
    return () => void told.delete(tell);
  }, []);
  return now;
}

export function ThemeButton(): JSX.Element {
  const other: Theme = useTheme() === 'dark' ? 'light' : 'dark';
  const change = (): void => {
    try {
      localStorage.setItem(kKey, other);
    } catch {
      // It holds until the page is left.
    }
    apply(other);
  };
  return (
    <button onClick={change} title={`Change to ${other} colours`}>
      {other === 'light' ? 'Light' : 'Dark'}
    </button>
  );
}
