// Blood: how much is lost, how fast it runs, and where it has gone.

import type { JSX } from 'preact';
import type { Blood } from './replica';

export const millilitres = (ml: number): string => `${ml.toFixed(1)} ml`;

// Nothing until something has bled. Only what bleeds is read out by itself: figures change all the
// time.
export function BloodPanel(props: { blood: Blood | null }): JSX.Element | null {
  const { blood } = props;
  if (!blood || blood.shedMl <= 0) return null;
  const hasVessel = blood.openVessels > 0,
    bleeds = blood.mlPerMinute > 0;
  return (
    <section class="blood" aria-label="Blood lost">
      <h2>Blood lost: {millilitres(blood.shedMl)}</h2>
      <p>
        <span role="status" class={hasVessel ? 'strong' : ''}>
          {hasVessel ? 'A vessel bleeds' : bleeds ? 'It bleeds' : 'Nothing bleeds'}
        </span>
        {(hasVessel || bleeds) && (
          <span>{`, ${blood.mlPerMinute.toFixed(hasVessel ? 0 : 1)} ml/min`}</span>
        )}
      </p>
      <dl>
        <dt>On the organ</dt>
        <dd>{millilitres(blood.onSurfaceMl)}</dd>
        <dt>Sucked off</dt>
        <dd>{millilitres(blood.suckedMl)}</dd>
        <dt>Dripped off</dt>
        <dd>{millilitres(blood.drippedMl)}</dd>
      </dl>
    </section>
  );
}
